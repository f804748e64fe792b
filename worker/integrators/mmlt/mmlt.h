// Multiplexed Metropolis light transport [Hachisuka 2014]: the length of the path and the technique that
// makes it are part of a chain's state.
#pragma once

#include <memory>

#include "worker/integrators/integrator.h"
#include "worker/integrators/mmlt/settings.h"

namespace candela::integrators {

Result<std::unique_ptr<Integrator>> make_mmlt_integrator(const SettingsMap& settings,
                                                         const scene::SceneFeatures& features);

}  // namespace candela::integrators
