// Curves as meshes of tubes: rings of vertices across the curve, joined by triangles. A ring's polygon is as
// wide as the circle in the mean over the directions it is seen from.
#pragma once

#include <vector>

#include "worker/loaders/curves.h"
#include "worker/loaders/mesh.h"
#include "worker/loaders/pbrt_curve.h"

namespace candela::scene {

// A uniform cubic B-spline through each curve's control points (four or more), without caps at the ends.
loaders::Mesh bspline_tubes(const std::vector<loaders::Curve>& curves);

// Straight segments from point to point, mitered where they meet, without caps at the ends.
loaders::Mesh linear_tubes(const std::vector<loaders::Curve>& curves);

// The cubic pieces of each list, joined. u goes along a curve and v around it, as in pbrt.
loaders::Mesh piecewise_tubes(const std::vector<loaders::PieceList>& curves);

}  // namespace candela::scene
