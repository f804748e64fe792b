// Which techniques of bidirectional path tracing a scene has paths for.
#pragma once

#include "worker/estimators/options.h"
#include "worker/integrators/plan.h"
#include "worker/scene/features.h"

namespace candela::integrators::bidirectional {

struct Planned {
  estimators::Techniques techniques;
  transport::Between between = transport::Between::media;
};
// Items go to `plan`. full: leaves out only what the options do.
Planned plan(const estimators::PathOptions& options, const scene::SceneFeatures& features, bool full,
             Plan& plan);

}  // namespace candela::integrators::bidirectional
