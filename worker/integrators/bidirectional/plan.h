// Which techniques of bidirectional path tracing a scene has paths for.
#pragma once

#include "worker/integrators/planned.h"
#include "worker/scene/features.h"

namespace candela::integrators::bidirectional {

Planned plan(const estimators::PathOptions& options, const scene::SceneFeatures& features, bool full);

}  // namespace candela::integrators::bidirectional
