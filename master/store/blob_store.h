// Blobs by the SHA-256 of their bytes, as files DATA/blobs/ab/<sha256>. A blob is stored whole and verified
// or not at all. Disks forget: whoever reads a blob through this class learns whether it still is what its
// name says. One that is not is moved to DATA/blobs/damaged, and the blob is missing from then on.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>

#include "common/base/hash.h"
#include "common/base/mutex.h"
#include "common/base/result.h"

namespace candela::master {

class BlobStore {
 public:
  // Creates the folder, and removes what interrupted uploads left.
  static Result<std::unique_ptr<BlobStore>> open(const std::filesystem::path& folder);

  // Size in bytes; nothing if it is not there. Says nothing of its content. Precondition of all that take a
  // hash: is_sha256_hex(sha256).
  std::optional<std::uint64_t> size(const std::string& sha256) const;
  std::filesystem::path path(const std::string& sha256) const;

  // Reads the whole file. True: the blob is what its name says. False: it is missing, or it was damaged and
  // has been set aside. Errors: it cannot be read now, which says nothing of it.
  Result<bool> check(const std::string& sha256);

  // Somebody relies on the blob from now on, whether or not it is there: it is not collected within the grace
  // of a collect(), which is time enough to name it in a job. check(), begin() and finish() say so too.
  void use(const std::string& sha256);

  struct Collected {
    std::uint64_t kept = 0, kept_bytes = 0;  // blobs
    std::uint64_t removed = 0, removed_bytes = 0;
  };
  // Removes each blob that `needed` lacks, that nobody used for `grace_seconds`, and whose file is older than
  // that: before this store was opened the file's own time tells.
  Result<Collected> collect(const std::set<std::string>& needed, double grace_seconds);

  // One blob being read, in order.
  class Reader {
   public:
    ~Reader();
    Reader(const Reader&) = delete;
    Reader& operator=(const Reader&) = delete;
    std::uint64_t size() const { return size_; }
    // The next bytes, at most so many; empty at the end. The last bytes are given only when all were found to
    // have the hash. ErrorKind::failed: the blob is damaged and has been set aside.
    Result<void> next(std::size_t most_bytes, std::string& out);

   private:
    friend class BlobStore;
    explicit Reader(BlobStore& store) : store_(store) {}
    Error damaged(const std::string& why);
    BlobStore& store_;
    int fd_ = -1;
    std::string sha256_;
    std::uint64_t size_ = 0, read_ = 0;
    bool checked_ = false;
    Sha256 hash_;
  };
  // Null: it is missing.
  Result<std::unique_ptr<Reader>> read(const std::string& sha256);

  // One upload in progress. Destroyed before finish() succeeded, it leaves nothing.
  class Upload {
   public:
    ~Upload();
    Upload(const Upload&) = delete;
    Upload& operator=(const Upload&) = delete;
    Result<void> append(std::string_view data);
    // Verifies length and hash, syncs and makes it visible. A mismatch is ErrorKind::failed.
    Result<void> finish();

   private:
    friend class BlobStore;
    explicit Upload(BlobStore& store) : store_(store) {}
    BlobStore& store_;
    int fd_ = -1;
    std::filesystem::path temporary_, final_;
    std::string sha256_;
    std::uint64_t size_ = 0, received_ = 0;
    Sha256 hash_;
  };
  // Stores a file of this disk, if the blob is not there yet. ErrorKind::failed: the file is not what the
  // hash says.
  Result<void> take(const std::string& sha256, std::uint64_t size_bytes, const std::filesystem::path& file);

  // Checks limits and the free space of the disk.
  Result<std::unique_ptr<Upload>> begin(const std::string& sha256, std::uint64_t size_bytes);

 private:
  void set_aside(const std::string& sha256, int fd);

  std::filesystem::path folder_;
  std::atomic<std::uint64_t> serial_{0};
  Mutex names_mutex_;  // of what a name stands for: a new upload, or a file that goes
  std::map<std::string, double> used_ CANDELA_GUARDED_BY(names_mutex_);  // when, by the steady clock
};

}  // namespace candela::master
