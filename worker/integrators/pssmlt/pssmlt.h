// Metropolis light transport in primary sample space [Kelemen 2002]: chains over the random numbers of path
// tracing or bidirectional path tracing.
#pragma once

#include <memory>

#include "worker/integrators/integrator.h"
#include "worker/integrators/pssmlt/settings.h"

namespace candela::integrators {

Result<std::unique_ptr<Integrator>> make_pssmlt_integrator(const SettingsMap& settings,
                                                           const scene::SceneFeatures& features);

}  // namespace candela::integrators
