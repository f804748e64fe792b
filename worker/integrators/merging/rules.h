// How an integrator of the family merges.
#pragma once

#include "worker/transport/kernels.h"

namespace candela::integrators::merging {

struct MergeRules {
  transport::Kernel kernel = transport::Kernel::constant;
  double radius = 0, radius_pixels = 0;  // see first_radius()
  int radius_neighbors = 0;              // above 0: see neighbor_radius()
  double alpha = 1;
  double light_paths = 1;  // per pixel
};

}  // namespace candela::integrators::merging
