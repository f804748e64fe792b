// Geometry::finish() in two steps. Embree's tree is built between them: it reads positions and indices alone,
// and the memory that its construction takes is free again when the records of triangles are made.
#pragma once

#include <array>
#include <cstdint>

#include "worker/core/vec.h"
#include "worker/scene/shapes/geometry.h"

namespace candela::scene {

// After the last shape.
void finish_vertices(Geometry& geometry);
// Makes Geometry::triangles. Until then the array has one element for each shape, which its triangles start
// from.
void make_triangles(Geometry& geometry);

// The corners of a triangle whether or not it has a record.
inline std::array<Vec3, 3> corners_of(const Geometry& geometry, std::uint32_t triangle) {
  const auto& v = geometry.indices[triangle];
  return {geometry.positions[v[0]], geometry.positions[v[1]], geometry.positions[v[2]]};
}

}  // namespace candela::scene
