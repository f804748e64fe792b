// Which techniques of bidirectional path tracing a scene has paths for.
#pragma once

#include "worker/integrators/bdpt/kernel.h"
#include "worker/integrators/plan.h"
#include "worker/scene/features.h"

namespace candela::integrators::bdpt {

struct Planned {
  Techniques techniques;
  transport::Between between = transport::Between::media;
};
// Items go to `plan`. full: leaves out only what the limits do.
Planned plan(const Limits& limits, const scene::SceneFeatures& features, bool full, Plan& plan);

}  // namespace candela::integrators::bdpt
