// Polygons cut into triangles.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "worker/core/vec.h"

namespace candela::loaders {

// A polygon of more than three corners in a list of triangles, where it is a fan around its first corner.
struct Polygon {
  std::size_t first_triangle = 0;
  std::uint32_t corner_count = 0;  // it has two triangles fewer
};

using Triangles = std::vector<std::array<std::uint32_t, 3>>;

// Replaces the fans that do not cover their polygon by triangles that do, as many as before, turning the same
// way as the polygon. `parallel`: lists with an entry for each triangle, which are changed alike; they may be
// empty. Polygons need not be planar or convex; edges may touch or coincide, such as those of a bridge to a
// hole. Of a polygon whose edges cross, the triangles are some. An error if a polygon of very many corners
// would take very long; `name` is for the error.
Result<void> cut_polygons(std::span<const Vec3> positions, std::span<const Polygon> polygons,
                          Triangles& triangles, std::span<Triangles* const> parallel,
                          const std::string& name);

}  // namespace candela::loaders
