// Finds the statistics that a thread may add to without atomic operations.
#pragma once

#include <algorithm>
#include <cstdint>

namespace candela::integrators::merging {

// The pixels of one tile [x0, x1) x [y0, y1) of a film that no path of another tile has its film position in
// (transport::pixel_of): paths are scattered by the filter.
class PixelsAlone {
 public:
  PixelsAlone(std::uint32_t width, std::uint32_t height, double filter_radius, std::uint32_t x0,
              std::uint32_t y0, std::uint32_t x1, std::uint32_t y1) {
    // Pixels between a path's own and that of its position. 0.01: positions on large films are rounded.
    const auto reach = static_cast<std::uint32_t>(filter_radius + 0.51);
    x0_ = x0 == 0 ? 0 : x0 + reach;
    y0_ = y0 == 0 ? 0 : y0 + reach;
    x1_ = x1 == width ? x1 : x1 - std::min(x1, reach);
    y1_ = y1 == height ? y1 : y1 - std::min(y1, reach);
  }
  bool contains(std::uint32_t x, std::uint32_t y) const { return x >= x0_ && x < x1_ && y >= y0_ && y < y1_; }

 private:
  std::uint32_t x0_, y0_, x1_, y1_;
};

}  // namespace candela::integrators::merging
