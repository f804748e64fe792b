#include "common/image/exif.h"

#include <cstdint>

namespace candela::image {

int exif_orientation(const unsigned char* bytes, std::size_t size) {
  constexpr unsigned kTag = 0x112;
  if (size < 8) return 1;
  const bool big = bytes[0] == 'M';
  const auto number = [&](std::size_t at, std::size_t count) {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < count; ++i) value = value << 8 | bytes[at + (big ? i : count - 1 - i)];
    return value;
  };
  const std::size_t directory = number(4, 4);
  if (directory > size - 2) return 1;
  const std::size_t entries = number(directory, 2);
  for (std::size_t i = 0; i < entries; ++i) {
    const std::size_t entry = directory + 2 + 12 * i;
    if (entry + 12 > size) return 1;
    if (number(entry, 2) == kTag) return static_cast<int>(number(entry + 8, 2));
  }
  return 1;
}

}  // namespace candela::image
