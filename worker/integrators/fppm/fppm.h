// Progressive photon mapping whose radius follows, at each pixel, from F tests of the light in sectors around
// the gather points [Lin 2023].
#pragma once

#include <memory>

#include "worker/integrators/fppm/settings.h"
#include "worker/integrators/integrator.h"

namespace candela::integrators {

Result<std::unique_ptr<Integrator>> make_fppm_integrator(const SettingsMap& settings,
                                                         const scene::SceneFeatures& features);

}  // namespace candela::integrators
