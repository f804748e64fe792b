// Vertex connection and merging, and bidirectional photon mapping: what is left of it without connections.
#pragma once

#include <memory>

#include "worker/integrators/integrator.h"
#include "worker/integrators/vcm/settings.h"

namespace candela::integrators {

Result<std::unique_ptr<Integrator>> make_vcm_integrator(const SettingsMap& settings,
                                                        const scene::SceneFeatures& features);
Result<std::unique_ptr<Integrator>> make_bpm_integrator(const SettingsMap& settings,
                                                        const scene::SceneFeatures& features);

}  // namespace candela::integrators
