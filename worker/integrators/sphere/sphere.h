// The integrator of the jobs of `candela inspect sphere`: a path tracer whose film is a map of the directions
// around a place (probe.h).
#pragma once

#include "worker/integrators/integrator.h"
#include "worker/integrators/sphere/settings.h"

namespace candela::integrators {

Result<std::unique_ptr<Integrator>> make_sphere_integrator(const SettingsMap& settings,
                                                           const scene::SceneFeatures& features);

}  // namespace candela::integrators
