// Parts of path tracing that a scene needs.
#pragma once

#include "worker/integrators/plan_light.h"
#include "worker/integrators/planned.h"
#include "worker/scene/features.h"

namespace candela::integrators::path {

// True if next event estimation has a ray for the environment and one for lamps (docs/integrators/path.md).
bool ray_a_group(const scene::SceneFeatures& features);

// rays_a_group: its caller traces a shadow ray for each group of lights, where next event estimation runs.
// mollifies: of its caller, what the techniques cannot sample.
Planned plan(const estimators::PathOptions& options, const scene::SceneFeatures& features, bool full,
             bool rays_a_group = false, Mollifies mollifies = Mollifies::never);

}  // namespace candela::integrators::path
