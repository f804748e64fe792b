// Blobs on this machine's disk, named by their SHA-256: CACHE/blobs/ab/<sha256>. Several workers may share a
// folder: files appear whole by rename, vanish by unlink (which hurts nobody who has mapped them), and are
// mapped only after their hash has been checked in this process, and again where device, inode, size, mtime
// or ctime are no longer those of the file that was checked. The time of last use, by which the oldest go
// first, is the file's mtime, to a minute. Folders that somebody removes are made again.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>

#include "common/base/files.h"
#include "common/base/mutex.h"
#include "common/base/result.h"

namespace candela::worker {

class BlobCache {
 public:
  // The file that may hold a blob beside the cache, such as in the store of a master in this process. It need
  // not exist, nor be what its name says.
  using Beside = std::function<std::filesystem::path(const std::string& sha256)>;
  // Creates the folders and removes what interrupted downloads left long ago. A file beside the cache that is
  // the blob is read where it lies, in place of a download.
  static Result<std::unique_ptr<BlobCache>> open(const std::filesystem::path& folder,
                                                 std::uint64_t limit_bytes, Beside beside = {});

  // Delivers a blob's bytes in order through the sink and fails where the sink does.
  using Sink = std::function<Result<void>(std::string_view)>;
  using Fetch =
      std::function<Result<void>(const std::string& sha256, std::uint64_t size_bytes, const Sink& sink)>;

  // While a pin lives, its blob is not evicted by this process.
  using Pin = std::shared_ptr<const void>;
  // The blob is on disk, now or after a download, and is not evicted. map() checks its hash, so that a large
  // file is not read once more here. Errors: `resource` where the disk is full or the limit leaves no room,
  // `failed` where what came is not the blob, and the fetch's own.
  Result<Pin> ensure(const std::string& sha256, std::uint64_t size_bytes, const Fetch& fetch);

  // The blob's bytes, fetched again if somebody else has removed it meanwhile. The owner pins it.
  struct Mapped {
    std::shared_ptr<const void> owner;
    std::string_view bytes;
  };
  Result<Mapped> map(const std::string& sha256, std::uint64_t size_bytes, const Fetch& fetch);

  std::filesystem::path path_of(const std::string& sha256) const;
  std::uint64_t limit_bytes() const { return limit_bytes_; }

 private:
  // Outlives the cache where pins do.
  struct Pins {
    Mutex mutex;
    std::map<std::string, unsigned> counts CANDELA_GUARDED_BY(mutex);
  };
  // Device, inode, size, mtime and ctime in nanoseconds.
  using Identity = std::tuple<std::uint64_t, std::uint64_t, std::uint64_t, std::int64_t, std::int64_t>;
  struct Verified {
    Identity identity;
    // It was checked well after its last change. A change within the same tick of the file system's clock
    // would leave the same times, so a file checked earlier is checked again.
    bool settled = false;
  };

  BlobCache(std::filesystem::path folder, std::uint64_t limit_bytes, Beside beside);
  Pin pin(const std::string& sha256);
  static Result<std::optional<Identity>> identity_of(const std::filesystem::path& path);  // none: no file
  bool is_pinned(const std::string& sha256) const;
  Result<std::shared_ptr<const MappedFile>> open_verified(const std::filesystem::path& path,
                                                          const std::string& sha256,
                                                          std::uint64_t size_bytes);
  Result<void> download(const std::string& sha256, std::uint64_t size_bytes, const Fetch& fetch);
  // The file beside the cache, if it has the blob's size; else no path.
  std::filesystem::path beside(const std::string& sha256, std::uint64_t size_bytes) const;
  Result<void> make_room(std::uint64_t need_bytes);

  std::filesystem::path folder_;
  std::uint64_t limit_bytes_;
  Beside beside_;
  std::shared_ptr<Pins> pins_;
  Mutex mutex_;  // held during file metadata operations, never during a download
  std::map<std::string, Verified> verified_ CANDELA_GUARDED_BY(mutex_);
  std::uint64_t estimated_bytes_ CANDELA_GUARDED_BY(mutex_) =
      0;  // since the last scan; others' changes are unknown until the next
  std::chrono::steady_clock::time_point scanned_ CANDELA_GUARDED_BY(mutex_){};
  std::uint64_t serial_ CANDELA_GUARDED_BY(mutex_) = 0;
};

}  // namespace candela::worker
