// Bytes of an image file, which a reader asks for piece by piece.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string_view>

#include "common/base/result.h"

namespace candela::image {

class ByteSource {
 public:
  virtual ~ByteSource() = default;
  virtual std::uint64_t size() const = 0;
  // False if the file ends before at + count, or cannot be read.
  virtual bool read(std::uint64_t at, std::size_t count, void* out) = 0;
};

// `bytes` must outlive the source.
std::unique_ptr<ByteSource> memory_source(std::string_view bytes);

// Reads the file as it is asked to, so that a large file takes no memory. Errors name the file.
Result<std::unique_ptr<ByteSource>> file_source(const std::filesystem::path& path);

}  // namespace candela::image
