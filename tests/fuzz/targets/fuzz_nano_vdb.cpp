// load_nano_vdb on any bytes. A tree's nodes are too long for a mutation to make: an input whose first byte
// is not N is a list of patches, each of four bytes of offset, one byte of length and the bytes, on a file of
// 400 000 zeros.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string>
#include <string_view>

#include "worker/loaders/nano_vdb.h"

namespace {

constexpr std::size_t kPatchedBytes = 400'000;
// So that no input takes gigabytes.
constexpr std::uint64_t kMaxValues = std::uint64_t{1} << 18;

std::string patched(const std::uint8_t* data, std::size_t size) {
  std::string file(kPatchedBytes, '\0');
  while (size >= 5) {
    std::uint32_t offset = 0;
    std::memcpy(&offset, data, sizeof offset);
    const std::size_t length = std::min<std::size_t>(data[4], size - 5);
    offset %= kPatchedBytes - 255;
    std::memcpy(file.data() + offset, data + 5, length);
    data += 5 + length;
    size -= 5 + length;
  }
  return file;
}

void check(std::string_view bytes, const char* grid) {
  const auto volume = candela::loaders::load_nano_vdb(bytes, "x.nvdb", grid, kMaxValues);
  if (!volume.ok()) {
    if (volume.error().to_string().find('\n') != std::string::npos) std::abort();
    return;
  }
  const auto& n = volume->size;
  if (volume->channels != 1 || volume->values.size() != std::size_t{n[0]} * n[1] * n[2]) std::abort();
  if (volume->values.empty() || volume->values.size() > kMaxValues) std::abort();
  for (const float v : volume->values)
    if (!std::isfinite(v) || v < 0) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  const char* const grid = size % 3 == 0 ? "density" : "";
  if (bytes.starts_with('N')) {
    check(bytes, grid);
  } else {
    check(patched(data, size), grid);
  }
  return 0;
}
