// A box of cells, and the cells that a segment crosses.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "worker/core/vec.h"

namespace candela::integrators {

struct CellGrid {
  Vec3d low, high;                      // low < high
  std::array<std::uint32_t, 3> size{};  // cells along x, y, z; none is 0

  std::uint64_t count() const { return std::uint64_t{size[0]} * size[1] * size[2]; }
  // Edges of a cell.
  Vec3d cell() const {
    return {(high.x - low.x) / size[0], (high.y - low.y) / size[1], (high.z - low.z) / size[2]};
  }
};

// Calls visit(cell, length) for each cell that the segment crosses from `from` along `direction` (of length
// 1) up to `longest`, which may be infinite. Index of a cell: (z * size_y + y) * size_x + x. A face between
// two cells belongs to the upper one. The lengths add up to that of the segment in the box, but for rounding.
// [Amanatides and Woo 1987]
template <class Visit>
void for_each_cell(const CellGrid& grid, Vec3d from, Vec3d direction, double longest, const Visit& visit) {
  constexpr double never = std::numeric_limits<double>::infinity();
  const std::array<double, 3> o = {from.x, from.y, from.z}, d = {direction.x, direction.y, direction.z},
                              low = {grid.low.x, grid.low.y, grid.low.z},
                              high = {grid.high.x, grid.high.y, grid.high.z};
  double t = 0, end = longest;
  for (std::size_t a = 0; a < 3; ++a) {
    if (d[a] == 0) {
      if (!(o[a] >= low[a] && o[a] < high[a])) return;
      continue;
    }
    const double at_low = (low[a] - o[a]) / d[a], at_high = (high[a] - o[a]) / d[a];
    t = std::max(t, std::min(at_low, at_high));
    end = std::min(end, std::max(at_low, at_high));
  }
  if (!(t < end)) return;  // also for NaN
  const Vec3d edges = grid.cell();
  const std::array<double, 3> cell = {edges.x, edges.y, edges.z};
  std::array<std::int64_t, 3> at{};
  std::array<double, 3> next{};  // distance of the plane where the segment leaves its cell along each axis
  const auto leaves_at = [&](std::size_t a) {
    if (d[a] == 0) return never;
    return (low[a] + static_cast<double>(at[a] + (d[a] > 0 ? 1 : 0)) * cell[a] - o[a]) / d[a];
  };
  for (std::size_t a = 0; a < 3; ++a) {
    const double place = std::floor((o[a] + t * d[a] - low[a]) / cell[a]);
    at[a] = static_cast<std::int64_t>(std::clamp(place, 0.0, static_cast<double>(grid.size[a]) - 1));
    next[a] = leaves_at(a);
  }
  while (true) {
    const std::size_t axis = next[0] <= next[1] ? (next[0] <= next[2] ? 0 : 2) : (next[1] <= next[2] ? 1 : 2);
    const double leave = std::min(next[axis], end);
    if (leave > t) {
      const auto [x, y, z] = at;
      visit(static_cast<std::uint64_t>((z * grid.size[1] + y) * grid.size[0] + x), leave - t);
      t = leave;
    }
    if (next[axis] >= end) return;
    at[axis] += d[axis] > 0 ? 1 : -1;
    if (at[axis] < 0 || at[axis] >= grid.size[axis]) return;
    next[axis] = leaves_at(axis);
  }
}

}  // namespace candela::integrators
