// What path tracing needs for a scene.
#pragma once

#include "worker/integrators/path/techniques.h"
#include "worker/integrators/plan.h"
#include "worker/scene/features.h"

namespace candela::integrators::path {

// Items go to `plan`. full: leaves nothing out.
Techniques plan(const Limits& limits, const scene::SceneFeatures& features, bool full, Plan& plan);

}  // namespace candela::integrators::path
