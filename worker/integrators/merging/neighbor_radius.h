// The merging radius of the first iteration by the distance of photons.
#pragma once

#include "worker/estimators/options.h"
#include "worker/integrators/integrator.h"

namespace candela::integrators::merging {

// The radius of discs in which `neighbors` photons of an iteration of `light_paths` light paths lie: the
// median over a fixed grid of eye paths, at the first vertex on a surface that merges. From a pilot of a
// fixed number of light paths, which takes about a tenth of a second. 0 where there are too few photons or
// vertices. A pure function of the scene, the seed, the film's size and the arguments. Preconditions:
// neighbors >= 1, max_depth >= 2.
double neighbor_radius(const UnitContext& context, const estimators::PathOptions& options, int neighbors,
                       double light_paths);

}  // namespace candela::integrators::merging
