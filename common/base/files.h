// File access with errors that name the file, and writes that are whole or absent.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "common/base/result.h"

namespace candela {

// The whole file. Refuses what is not a regular file and what is larger than `limit_bytes`.
Result<std::string> read_file(const std::filesystem::path& path, std::uint64_t limit_bytes);

// The first `count` bytes, or all of a smaller file.
Result<std::string> read_start(const std::filesystem::path& path, std::size_t count);

// Fails where read_file() could not begin.
Result<void> check_readable_file(const std::filesystem::path& path);

// visit(bytes) for one part of the file after the other, through one buffer. Refuses what is not a regular
// file and what ends before the size that it had. Returns the size.
Result<std::uint64_t> read_in_parts(const std::filesystem::path& path,
                                    const std::function<Result<void>(std::string_view)>& visit);

// Write to a temporary name beside `path`, fsync, rename over it, fsync the folder. After an error or a crash
// `path` holds its old content or all of the new. A symbolic link stays, its target is written (links.h).
Result<void> write_file_atomically(const std::filesystem::path& path, std::string_view data);

// Creates the folder and its parents.
Result<void> make_directories(const std::filesystem::path& path);

// The bytes of a file; empty files have an empty view. The view lives as long as the object. Up to
// kCopiedBytes are copied, so that a file which somebody cuts short meanwhile is an error, or stays as it
// was. Larger ones are mapped: to cut one of those short while it is in use ends the process by SIGBUS.
class MappedFile {
 public:
  static constexpr std::uint64_t kCopiedBytes = std::uint64_t{256} << 20;
  // Files of up to so many bytes lie on the heap, whose pages serve one file after the other: the pages of a
  // mapping are cleared for each.
  static constexpr std::uint64_t kSmallBytes = std::uint64_t{4} << 20;
  static Result<std::shared_ptr<const MappedFile>> open(const std::filesystem::path& path);
  ~MappedFile();
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;
  std::string_view bytes() const { return {data_, size_}; }

 private:
  MappedFile() = default;
  const char* data_ = nullptr;
  std::size_t size_ = 0;
  std::unique_ptr<char[]> small_;  // holds the bytes if they are few; else they are mapped
};

}  // namespace candela
