// Progressive photon mapping whose radius minimizes, at each pixel, the mean squared error as estimated from
// the second moment and the Laplacian of the light around the gather points [Kaplanyan 2017, chapter 5].
#pragma once

#include <memory>

#include "worker/integrators/appm/settings.h"
#include "worker/integrators/integrator.h"

namespace candela::integrators {

Result<std::unique_ptr<Integrator>> make_appm_integrator(const SettingsMap& settings,
                                                         const scene::SceneFeatures& features);

}  // namespace candela::integrators
