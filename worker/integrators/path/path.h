// Unidirectional path tracing from the eye: next event estimation and bsdf sampling combined by multiple
// importance sampling (Veach 1997, ch. 9), Russian roulette on the throughput.
#pragma once

#include <memory>

#include "worker/integrators/integrator.h"
#include "worker/integrators/path/settings.h"

namespace candela::integrators {

Result<std::unique_ptr<Integrator>> make_path_integrator(const SettingsMap& settings,
                                                         const scene::SceneFeatures& features);

}  // namespace candela::integrators
