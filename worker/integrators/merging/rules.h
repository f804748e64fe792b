// Rules by which an integrator of the family merges.
#pragma once

#include "worker/transport/kernels.h"

namespace candela::integrators::merging {

// The first radius where a pilot finds nothing to choose it by, as a fraction of the radius of the scene's
// bounding sphere.
inline constexpr double kFallbackFraction = 0.003;

struct MergeRules {
  transport::Kernel kernel = transport::Kernel::constant;
  double radius = 0, radius_pixels = 0;  // see first_radius()
  int radius_neighbors = 0;              // above 0: see neighbor_radius()
  double alpha = 1;
  double light_paths = 1;       // per pixel
  bool separate_media = false;  // an automatic radius is that of surfaces alone
  bool adapts = false;          // radii shrink where tests find that they blur

  // The first radius follows from a pilot: choose_radius().
  bool is_automatic() const { return radius <= 0 && radius_pixels <= 0 && radius_neighbors <= 0; }
};

}  // namespace candela::integrators::merging
