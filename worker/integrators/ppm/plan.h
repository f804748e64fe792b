// Techniques that a scene needs.
#pragma once

#include "worker/integrators/planned.h"
#include "worker/scene/features.h"

namespace candela::integrators::ppm {

// caustics_only: of photons, those alone that a specular vertex sent.
Planned plan(const estimators::PathOptions& options, bool caustics_only, const scene::SceneFeatures& features,
             bool full);

}  // namespace candela::integrators::ppm
