#include "common/film/layout.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "common/job/job.h"

namespace candela::film {

Result<void> validate(const Layout& layout, int scale_log2) {
  if (layout.width == 0 || layout.height == 0 || layout.width > Limits::max_extent ||
      layout.height > Limits::max_extent || layout.pixel_count() > Limits::max_pixels) {
    return input_error("a film of " + std::to_string(layout.width) + " x " + std::to_string(layout.height) +
                       " pixels is not possible")
        .with_field("layout")
        .with_mend("use 1 to " + std::to_string(Limits::max_extent) + " pixels a side and at most " +
                   std::to_string(Limits::max_pixels) + " together");
  }
  if (layout.layers == 0 || layout.layers > kMaxLayers ||
      layout.pixel_count() * layout.layers > kMaxLayerPixels) {
    return input_error("a film of " + std::to_string(layout.layers) + " layers is not possible")
        .with_field("layers")
        .with_mend("use 1 to " + std::to_string(kMaxLayers) + " layers, fewer for very large films");
  }
  if (scale_log2 < -kMaxScaleLog2 || scale_log2 > kMaxScaleLog2) {
    return input_error("a film scale of 2^" + std::to_string(scale_log2) + " is not possible")
        .with_field("film_scale_log2")
        .with_mend("use -" + std::to_string(kMaxScaleLog2) + " to " + std::to_string(kMaxScaleLog2));
  }
  return {};
}

int scale_log2_for(double mean_luminance) {
  constexpr int kMeanLog2 = 20;
  int exponent = 0;
  std::frexp(mean_luminance, &exponent);
  return std::clamp(kMeanLog2 - exponent, -126, 126);
}

TileRect tile_rect(const Layout& layout, std::size_t tile_index) {
  const std::size_t per_layer = std::size_t{layout.tiles_x()} * layout.tiles_y();
  const std::size_t in_layer = tile_index % per_layer;
  TileRect rect{};
  rect.layer = static_cast<std::uint32_t>(tile_index / per_layer);
  rect.x = static_cast<std::uint32_t>(in_layer % layout.tiles_x()) * kTileSize;
  rect.y = static_cast<std::uint32_t>(in_layer / layout.tiles_x()) * kTileSize;
  rect.width = std::min<std::uint32_t>(kTileSize, layout.width - rect.x);
  rect.height = std::min<std::uint32_t>(kTileSize, layout.height - rect.y);
  return rect;
}

}  // namespace candela::film
