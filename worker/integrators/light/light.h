// Light tracing: paths from the emitters, each vertex connected to the lens [Dutre 1993], and light that
// meets a finite lens by itself. Emitters seen directly are found by eye rays. What the camera sees by
// specular reflection or refraction alone no connection to the lens can find: see docs/integrators/light.md.
#pragma once

#include <memory>

#include "worker/integrators/integrator.h"
#include "worker/integrators/light/settings.h"

namespace candela::integrators {

Result<std::unique_ptr<Integrator>> make_light_integrator(const SettingsMap& settings,
                                                          const scene::SceneFeatures& features);

}  // namespace candela::integrators
