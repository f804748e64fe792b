// A path of a chain in path space, with what its contribution and its mutations need. All of it follows from
// the path.
#pragma once

#include <array>
#include <optional>

#include "worker/scene/scene.h"
#include "worker/transport/path/assemble.h"
#include "worker/transport/path/path.h"

namespace candela::mcmc {

struct PathState {
  transport::path::Path path;
  transport::path::Assembled assembled;
  // By channel, in the product of area measures, delta functions of specular vertices left out. A light or
  // sensor that no ray meets has its own in the place of an area.
  std::array<double, 3> contribution{};
  double scalar = 0;  // its luminance, > 0 and finite
};

// Nothing: the path carries no light, or it leaves the film.
std::optional<PathState> path_state(const scene::Scene& scene, transport::path::Path path,
                                    float film_border = 0);

}  // namespace candela::mcmc
