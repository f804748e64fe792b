// Blobs by the SHA-256 of their bytes, as files DATA/blobs/ab/<sha256>. A blob is there whole and verified or
// not at all.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "common/base/hash.h"
#include "common/base/result.h"

namespace candela::master {

class BlobStore {
 public:
  // Creates the folder, and removes what interrupted uploads left.
  static Result<std::unique_ptr<BlobStore>> open(const std::filesystem::path& folder);

  // Size in bytes; nothing if it is not there. Precondition: is_sha256_hex(sha256).
  Result<bool> check(const std::string& sha256) const;
  std::optional<std::uint64_t> size(const std::string& sha256) const;
  std::filesystem::path path(const std::string& sha256) const;

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
    Upload() = default;
    int fd_ = -1;
    std::filesystem::path temporary_, final_;
    std::string sha256_;
    std::uint64_t size_ = 0, received_ = 0;
    Sha256 hash_;
  };
  // Checks limits and the free space of the disk.
  Result<std::unique_ptr<Upload>> begin(const std::string& sha256, std::uint64_t size_bytes);

 private:
  std::filesystem::path folder_;
  std::atomic<std::uint64_t> serial_{0};
};

}  // namespace candela::master
