// Estimates how long light scatters in a scene's media before it leaves or is absorbed.
#pragma once

#include "worker/scene/media/media.h"
#include "worker/scene/shapes/geometry.h"

namespace candela::scene {

struct ThickMedium {
  // Share of a long walk that a scattering leaves: squared albedo times the probability of not leaving,
  // (atan(B) / B)^(1 - g) for the slowest mode in a box, which in reduced mean free paths 1 / ((1 - g)
  // sigma_t) has sides l_i and the wave number B^2 = sum_i (pi / (l_i + 1.42))^2, with 1.42 for two of the
  // extrapolation lengths of Milne's problem. 0: no medium scatters.
  double fraction = 0;
  double thickness = 0;  // the shortest side of that box, in mean free paths
};

// Returns those of the medium and channel with the largest. The box: the largest of the shapes that hold the
// medium, or of all of them where each is flat (the walls of a tank); where none holds it, it has no end, and
// the thickness is infinite. Grids count with their densest and whitest place: an upper bound. Shapes of
// shapegroups count as if placed once and unscaled.
ThickMedium thickest_medium(const Media& media, const Geometry& geometry);

}  // namespace candela::scene
