// Techniques that a scene needs.
#pragma once

#include "worker/integrators/planned.h"
#include "worker/scene/features.h"

namespace candela::integrators::vcm {

// wanted: what the integrator would run at most.
Planned plan(const estimators::PathOptions& options, const estimators::Techniques& wanted,
             const scene::SceneFeatures& features, bool full);

}  // namespace candela::integrators::vcm
