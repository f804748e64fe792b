// Progressive photon mapping whose radius follows, at each pixel, from chi-squared tests of the numbers of
// photons in sectors around the gather points [Lin 2020].
#pragma once

#include <memory>

#include "worker/integrators/cppm/settings.h"
#include "worker/integrators/integrator.h"

namespace candela::integrators {

Result<std::unique_ptr<Integrator>> make_cppm_integrator(const SettingsMap& settings,
                                                         const scene::SceneFeatures& features);

}  // namespace candela::integrators
