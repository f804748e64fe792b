// Volume files in memory, for tests.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace candela::test {

// A .vol file; values in its encoding already (1: float32 written from `values`).
inline std::string volume_file(std::array<std::int32_t, 3> size, std::int32_t channels,
                               const std::vector<float>& values, std::int32_t encoding = 1,
                               std::array<float, 6> box = {0, 0, 0, 1, 1, 1}, const std::string& raw = "") {
  std::string bytes = "VOL\x03";
  const auto put = [&](const void* data, std::size_t count) {
    bytes.append(static_cast<const char*>(data), count);
  };
  put(&encoding, 4);
  put(size.data(), 12);
  put(&channels, 4);
  put(box.data(), 24);
  put(values.data(), values.size() * 4);
  return bytes + raw;
}

}  // namespace candela::test
