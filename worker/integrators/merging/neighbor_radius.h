// The merging radius of the first iteration by the distance of photons.
#pragma once

#include <cstdint>

#include "worker/estimators/options.h"
#include "worker/integrators/integrator.h"

namespace candela::integrators::merging {

// The pilot of neighbor_radius(), which by default takes about a tenth of a second.
struct NeighborPilot {
  std::uint64_t light_paths = 1 << 14;
  int grid = 32;       // by as many eye paths
  bool media = false;  // an eye path's first vertex may be in a medium: the radius of a ball is found there
};

// The radius of discs in which `neighbors` photons of an iteration of `light_paths` light paths lie: the
// median over a fixed grid of eye paths, at the first vertex on a surface that merges. 0 where there are too
// few photons or vertices. A pure function of the scene, the seed, the film's size and the arguments.
// Preconditions: neighbors >= 1, max_depth >= 2.
double neighbor_radius(const UnitContext& context, const estimators::PathOptions& options, int neighbors,
                       double light_paths, const NeighborPilot& pilot = {});

}  // namespace candela::integrators::merging
