// Path tracing whose direct light at the first vertex that is not specular has optimal weights
// [Kondapaneni 2019], found from the sums of the whole job when its image is read.
#pragma once

#include <memory>

#include "worker/integrators/integrator.h"
#include "worker/integrators/optimis/settings.h"

namespace candela::integrators {

Result<std::unique_ptr<Integrator>> make_optimis_integrator(const SettingsMap& settings,
                                                            const scene::SceneFeatures& features);

}  // namespace candela::integrators
