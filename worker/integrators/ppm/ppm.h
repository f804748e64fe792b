// Stochastic progressive photon mapping [Hachisuka 2009] in the form of [Knaus 2011]: every iteration has
// light paths of its own and a radius that follows from its number.
#pragma once

#include <memory>

#include "worker/integrators/integrator.h"
#include "worker/integrators/ppm/settings.h"

namespace candela::integrators {

Result<std::unique_ptr<Integrator>> make_ppm_integrator(const SettingsMap& settings,
                                                        const scene::SceneFeatures& features);

}  // namespace candela::integrators
