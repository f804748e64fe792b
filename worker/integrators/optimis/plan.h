// What optimis does with a scene.
#pragma once

#include "worker/estimators/first_vertex.h"
#include "worker/integrators/optimis/settings.h"
#include "worker/integrators/planned.h"
#include "worker/scene/features.h"

namespace candela::integrators::optimis {

struct PlannedFirstVertex {
  Planned planned;
  estimators::FirstVertexSetup setup;  // without techniques: the path tracer's own
};

PlannedFirstVertex plan(const OptimisSettings& settings, const estimators::PathOptions& options,
                        const scene::SceneFeatures& features);

}  // namespace candela::integrators::optimis
