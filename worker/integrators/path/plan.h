// What path tracing needs for a scene.
#pragma once

#include "worker/estimators/options.h"
#include "worker/integrators/plan.h"
#include "worker/scene/features.h"

namespace candela::integrators::path {

struct Planned {
  estimators::Techniques techniques;
  transport::Between between = transport::Between::media;
};
// Items go to `plan`. full: leaves nothing out.
Planned plan(const estimators::PathOptions& options, const scene::SceneFeatures& features, bool full,
             Plan& plan);

}  // namespace candela::integrators::path
