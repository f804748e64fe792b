// A film without its sums: its size, its layers, its scale, and the tiles it is divided into.
#pragma once

#include <cstddef>
#include <cstdint>

#include "common/base/result.h"

namespace candela::film {

// Pixels a side; the unit of sparseness in deltas and of width in merged films.
inline constexpr int kTileSize = 32;
inline constexpr int kChannels = 3;  // linear Rec.709 R, G, B

struct Layout {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::uint32_t layers = 1;  // layer 0 is the image
  bool operator==(const Layout&) const = default;
  std::size_t pixel_count() const { return std::size_t{width} * height; }
  std::uint32_t tiles_x() const { return (width + kTileSize - 1) / kTileSize; }
  std::uint32_t tiles_y() const { return (height + kTileSize - 1) / kTileSize; }
  std::size_t tile_count() const { return std::size_t{tiles_x()} * tiles_y() * layers; }
};

// Bounds of what a film may be. A quantity of 2^-200 to 2^200 a unit covers every float and its square.
inline constexpr int kMaxScaleLog2 = 200;
inline constexpr std::uint32_t kMaxLayers = 64;
inline constexpr std::uint64_t kMaxLayerPixels = 1ULL << 30;  // width * height * layers
// Fails (input) unless layout and scale are within Limits and the bounds above. The constructors of films
// require it.
Result<void> validate(const Layout& layout, int scale_log2);
// A scale for an image whose mean luminance is about this, > 0: the mean becomes 2^19 to 2^20 film units.
// Rounding noise of one unit is then about 2^-20 of the mean, far below any sample's noise, and one sample
// may still be 2^36 times the mean before it counts as saturated.
int scale_log2_for(double mean_luminance);

// The pixels of one tile, cut at the film's border. Index: (layer * tiles_y + tile_y) * tiles_x + tile_x.
struct TileRect {
  std::uint32_t layer, x, y, width, height;
  std::uint32_t pixels() const { return width * height; }
};
TileRect tile_rect(const Layout& layout, std::size_t tile_index);

}  // namespace candela::film
