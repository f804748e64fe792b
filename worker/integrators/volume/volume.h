// The integrator of the jobs of `candela inspect volume`: each path of bidirectional path tracing brings its
// contribution to the cells of a box that its edges cross [Kaplanyan 2017, 9.1.1.4]. An iteration is a sample
// of each pixel whose light is taken. The film (cell_film.h) has sum(contribution * length) of each cell.
#pragma once

#include "worker/integrators/integrator.h"
#include "worker/integrators/volume/settings.h"

namespace candela::integrators {

Result<std::unique_ptr<Integrator>> make_volume_integrator(const SettingsMap& settings,
                                                           const scene::SceneFeatures& features);

}  // namespace candela::integrators
