// Metropolis light transport in path space [Veach 1997, ch. 11]: the states of the chains are paths, and
// mutations change a part of a path.
#pragma once

#include <memory>

#include "worker/integrators/integrator.h"
#include "worker/integrators/mlt/settings.h"

namespace candela::integrators {

Result<std::unique_ptr<Integrator>> make_mlt_integrator(const SettingsMap& settings,
                                                        const scene::SceneFeatures& features);

}  // namespace candela::integrators
