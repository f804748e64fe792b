// What trained light selection learns: for each cell of a grid over the scene and each light, how many points
// of the light were tested from there, and how many of them were seen. The rule `light_visibility` makes the
// state of an epoch from the counts of all epochs before that are whole: a byte for each entry, the weight of
// the light's share of the choice in the cell.
//
// An entry has two integers, tested and seen, which lie one after the other in an accumulator of the job. Its
// pixels are room for entries: they have nothing to do with the film's.
#pragma once

#include <cstdint>
#include <string_view>

#include "common/film/accumulator.h"

namespace candela::light_visibility {

inline constexpr std::string_view kRule = "light_visibility";  // and the name of the state
inline constexpr std::string_view kCounts = "light.visibility";
inline constexpr std::string_view kEntries = "entries";  // the rule's constant

inline constexpr std::uint32_t kMaxSide = 16;  // cells along an axis
inline constexpr std::uint32_t kMaxLights = 64;
inline constexpr std::uint32_t kMaxPerPixel = 16;  // entries

struct Layout {
  std::uint32_t side = 1;  // of the grid, in cells; 0: the film has no room for the lights
  std::uint32_t lights = 0;
  std::uint32_t per_pixel = 1;  // entries

  // Entry of a light in a cell: cell * lights + light.
  std::uint32_t entries() const { return side * side * side * lights; }
};
// The finest grid that fits in a film of this size.
Layout layout(std::uint32_t width, std::uint32_t height, std::uint32_t lights);

// Where an entry's two integers are: its pixel, and the first of its channels there.
struct Place {
  std::uint32_t x, y, channel;
};
inline Place place(std::uint32_t entry, std::uint32_t per_pixel, std::uint32_t width) {
  const std::uint32_t pixel = entry / per_pixel;
  return {pixel % width, pixel / width, 2 * (entry % per_pixel)};
}
film::AccumulatorSpec spec(const Layout& layout);

// The weight of a light of which so many points were tested and seen. A choice in proportion to f sqrt(v) has
// the least variance where a point of value f is seen with probability v. v is estimated by
// (seen + 1) / (tested + 1); nothing tested: 255. Never below kMinWeight, so that no light is left out.
inline constexpr std::uint8_t kMaxWeight = 255, kMinWeight = 16;
std::uint8_t weight(std::uint64_t tested, std::uint64_t seen);

}  // namespace candela::light_visibility
