// Unified points, beams and paths [Krivanek 2014]: vcm with merges of points and beams in media.
#pragma once

#include <memory>

#include "worker/integrators/integrator.h"
#include "worker/integrators/upbp/settings.h"

namespace candela::integrators {

Result<std::unique_ptr<Integrator>> make_upbp_integrator(const SettingsMap& settings,
                                                         const scene::SceneFeatures& features);

}  // namespace candela::integrators
