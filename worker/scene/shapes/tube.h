// Curves as meshes of tubes: rings of vertices across the curve, joined by triangles. A ring's polygon is as
// wide as the circle in the mean over the directions it is seen from. A mesh of more than `max_triangles` is
// an error: a file of curves may be a thousandth of its mesh.
#pragma once

#include <cstddef>
#include <vector>

#include "common/base/result.h"
#include "worker/loaders/curves.h"
#include "worker/loaders/mesh.h"
#include "worker/loaders/pbrt_curve.h"

namespace candela::scene {

constexpr std::size_t kMaxTubeTriangles = std::size_t{1} << 28;

// A uniform cubic B-spline through each curve's control points (four or more), without caps at the ends.
Result<loaders::Mesh> bspline_tubes(const std::vector<loaders::Curve>& curves,
                                    std::size_t max_triangles = kMaxTubeTriangles);

// Straight segments from point to point, mitered where they meet, without caps at the ends.
Result<loaders::Mesh> linear_tubes(const std::vector<loaders::Curve>& curves,
                                   std::size_t max_triangles = kMaxTubeTriangles);

// The cubic pieces of each list, joined. u goes along a curve and v around it, as in pbrt.
Result<loaders::Mesh> piecewise_tubes(const std::vector<loaders::PieceList>& curves,
                                      std::size_t max_triangles = kMaxTubeTriangles);

}  // namespace candela::scene
