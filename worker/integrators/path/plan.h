// What path tracing needs for a scene.
#pragma once

#include "worker/integrators/planned.h"
#include "worker/scene/features.h"

namespace candela::integrators::path {

// Whether next event estimation has a shadow ray for the environment and one for lamps (docs/decisions/061).
bool ray_a_group(const scene::SceneFeatures& features);

Planned plan(const estimators::PathOptions& options, const scene::SceneFeatures& features, bool full);

}  // namespace candela::integrators::path
