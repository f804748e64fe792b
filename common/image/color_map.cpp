#include "common/image/color_map.h"

#include <algorithm>
#include <cmath>
#include <span>

namespace candela::image {
namespace {

// Every fifth of the 256 colors of viridis, by Nathaniel Smith, Stefan van der Walt and Eric Firing, as
// Matplotlib has it (_cm_listed.py, CC0). Between them the map is within 1/255 of the original.
constexpr std::uint32_t kViridis[] = {
    0x440154, 0x46085c, 0x471063, 0x481769, 0x481d6f, 0x482475, 0x472a7a, 0x46307e, 0x453781,
    0x433d84, 0x414287, 0x3f4889, 0x3d4e8a, 0x3a538b, 0x38598c, 0x355e8d, 0x33638d, 0x31688e,
    0x2e6d8e, 0x2c718e, 0x2a768e, 0x297b8e, 0x27808e, 0x25848e, 0x23898e, 0x218e8d, 0x20928c,
    0x1f978b, 0x1e9c89, 0x1fa188, 0x21a585, 0x24aa83, 0x28ae80, 0x2eb37c, 0x35b779, 0x3dbc74,
    0x46c06f, 0x50c46a, 0x5ac864, 0x65cb5e, 0x70cf57, 0x7cd250, 0x89d548, 0x95d840, 0xa2da37,
    0xb0dd2f, 0xbddf26, 0xcae11f, 0xd8e219, 0xe5e419, 0xf1e51d, 0xfde725};

// Every fifth of the 256 colors of Turbo, by Anton Mikhailov, Google, 2019 (Apache 2.0), likewise.
constexpr std::uint32_t kTurbo[] = {
    0x30123b, 0x36215f, 0x3b2f80, 0x3f3e9c, 0x424bb5, 0x4559cb, 0x4666dd, 0x4773eb, 0x4680f6,
    0x458cfd, 0x4099ff, 0x38a5fb, 0x2fb2f4, 0x27bee9, 0x1fc9dd, 0x1ad4d0, 0x18ddc2, 0x1ae4b6,
    0x22ebaa, 0x2ff19b, 0x3ff68a, 0x52fa7a, 0x65fd69, 0x79fe59, 0x8bff4b, 0x9cfe40, 0xa9fb39,
    0xb7f735, 0xc3f134, 0xd0ea34, 0xdbe236, 0xe5d938, 0xeecf3a, 0xf5c53a, 0xfaba39, 0xfdae35,
    0xfea130, 0xfe932a, 0xfc8423, 0xf9751d, 0xf46617, 0xef5811, 0xe84b0c, 0xe14109, 0xd83706,
    0xce2d04, 0xc32503, 0xb71d02, 0xa91601, 0x9b0f01, 0x8b0902, 0x7a0403};

// The 33 colors of the table that accompanies [Moreland 2009] ("cool-warm").
constexpr std::uint32_t kCoolWarm[] = {0x3b4cc0, 0x445acc, 0x4d68d7, 0x5775e1, 0x6282ea, 0x6c8ef1, 0x779af7,
                                       0x82a5fb, 0x8db0fe, 0x98b9ff, 0xa3c2ff, 0xaec9fd, 0xb8d0f9, 0xc2d5f4,
                                       0xccd9ee, 0xd5dbe6, 0xdddddd, 0xe5d8d1, 0xecd3c5, 0xf1ccb9, 0xf5c4ad,
                                       0xf7bba0, 0xf7b194, 0xf7a687, 0xf49a7b, 0xf18d6f, 0xec7f63, 0xe57058,
                                       0xde604d, 0xd55042, 0xcb3e38, 0xc0282f, 0xb40426};

constexpr std::uint32_t kGrey[] = {0x000000, 0xffffff};

// Black, red, yellow, white: the map `hot` of MATLAB, whose pieces are 3/8, 3/8 and 1/4 long.
constexpr std::uint32_t kHeat[] = {0x000000, 0x550000, 0xaa0000, 0xff0000, 0xff5500,
                                   0xffaa00, 0xffff00, 0xffff80, 0xffffff};

std::span<const std::uint32_t> colors_of(ColorMap map) {
  switch (map) {
    case ColorMap::viridis:
      return kViridis;
    case ColorMap::turbo:
      return kTurbo;
    case ColorMap::grey:
      return kGrey;
    case ColorMap::heat:
      return kHeat;
    case ColorMap::cool_warm:
      break;
  }
  return kCoolWarm;
}

}  // namespace

std::optional<ColorMap> color_map_of(std::string_view name) {
  const auto* const found = std::find(kColorMapNames.begin(), kColorMapNames.end(), name);
  if (found == kColorMapNames.end()) return std::nullopt;
  return static_cast<ColorMap>(found - kColorMapNames.begin());
}

Color8 color_at(ColorMap map, double t) {
  const std::span<const std::uint32_t> colors = colors_of(map);
  const double at = std::clamp(t, 0.0, 1.0) * static_cast<double>(colors.size() - 1);
  const std::size_t i = std::min(static_cast<std::size_t>(at), colors.size() - 2);
  const double f = at - static_cast<double>(i);
  Color8 color;
  for (std::size_t c = 0; c < 3; ++c) {
    const auto part = [&](std::uint32_t packed) {
      return static_cast<double>(packed >> (16 - 8 * c) & 0xff);
    };
    color[c] = static_cast<std::uint8_t>(std::lround(part(colors[i]) * (1 - f) + part(colors[i + 1]) * f));
  }
  return color;
}

}  // namespace candela::image
