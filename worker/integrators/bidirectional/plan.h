// Techniques of bidirectional path tracing that a scene has paths for.
#pragma once

#include "worker/integrators/plan_light.h"
#include "worker/integrators/planned.h"
#include "worker/scene/features.h"

namespace candela::integrators::bidirectional {

// mollifies: of its caller, what the techniques cannot sample.
Planned plan(const estimators::PathOptions& options, const scene::SceneFeatures& features, bool full,
             Mollifies mollifies = Mollifies::if_asked);

}  // namespace candela::integrators::bidirectional
