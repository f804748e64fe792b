// Bidirectional path tracing [Veach 1997, ch. 10]: a path from the eye and one from the light for each pixel,
// every vertex of the one connected to every vertex of the other, all weighed by multiple importance
// sampling.
#pragma once

#include <memory>

#include "worker/integrators/bdpt/settings.h"
#include "worker/integrators/integrator.h"

namespace candela::integrators {

Result<std::unique_ptr<Integrator>> make_bdpt_integrator(const SettingsMap& settings,
                                                         const scene::SceneFeatures& features);

}  // namespace candela::integrators
