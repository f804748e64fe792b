// What path tracing needs for a scene.
#pragma once

#include "worker/integrators/planned.h"
#include "worker/scene/features.h"

namespace candela::integrators::path {

Planned plan(const estimators::PathOptions& options, const scene::SceneFeatures& features, bool full);

}  // namespace candela::integrators::path
