// VCM+: vertex connection and merging whose radius follows, at each pixel, from F tests of the weighted light
// that merging finds in sectors around the eye's vertices [Lin 2023, section 6].
#pragma once

#include <memory>

#include "worker/integrators/integrator.h"
#include "worker/integrators/vcmplus/settings.h"

namespace candela::integrators {

Result<std::unique_ptr<Integrator>> make_vcmplus_integrator(const SettingsMap& settings,
                                                            const scene::SceneFeatures& features);

}  // namespace candela::integrators
