// The film that holds a grid of cells: its pixels, row by row, are the cells, and two more numbers.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "worker/integrators/volume/cell_grid.h"
#include "worker/integrators/volume/recorded_path.h"

namespace candela::integrators {

// Pixels behind those of the cells.
enum class CellFilmSum : std::uint64_t {
  light,     // of the paths
  crossing,  // the part of it whose paths cross the box
};
inline constexpr std::uint64_t kCellFilmSums = 2;

// The film's width: it is square, up to its last rows.
inline std::uint32_t cell_film_width(const CellGrid& grid) {
  return static_cast<std::uint32_t>(std::ceil(std::sqrt(static_cast<double>(grid.count() + kCellFilmSums))));
}
inline std::uint32_t cell_film_height(const CellGrid& grid) {
  const std::uint64_t width = cell_film_width(grid);
  return static_cast<std::uint32_t>((grid.count() + kCellFilmSums + width - 1) / width);
}
inline std::uint64_t cell_film_pixel(const CellGrid& grid, CellFilmSum sum) {
  return grid.count() + static_cast<std::uint64_t>(sum);
}

// Visits the cells of a path: visit(cell, length).
template <class Visit>
void for_each_cell_of(const CellGrid& grid, const RecordedPath& path, bool eye_edges, const Visit& visit) {
  const std::size_t edges = path.size() - (eye_edges ? 1 : 2);
  for (std::size_t i = 0; i < edges; ++i) {
    const Vec3d near = Vec3d(path[i + 1].p), edge = Vec3d(path[i].p) - near;
    const double distance = length(edge);
    if (!(distance > 0)) continue;
    // Light from outside comes from beyond any box.
    const double longest = path[i].infinite ? std::numeric_limits<double>::infinity() : distance;
    for_each_cell(grid, near, edge * (1 / distance), longest, visit);
  }
}

// Lengths in the film are in units of a cell's shortest edge.
inline double cell_film_unit(const CellGrid& grid) {
  const Vec3d cell = grid.cell();
  return std::min({cell.x, cell.y, cell.z});
}

}  // namespace candela::integrators
