// Which techniques a scene needs.
#pragma once

#include "worker/estimators/options.h"
#include "worker/integrators/plan.h"
#include "worker/scene/features.h"
#include "worker/transport/between.h"

namespace candela::integrators::vcm {

struct Planned {
  estimators::Techniques techniques;
  transport::Between between = transport::Between::media;
  Plan plan;
};

// wanted: what the integrator would run at most.
Planned make_plan(const estimators::Techniques& wanted, const estimators::PathOptions& options, bool full,
                  const scene::SceneFeatures& features);

}  // namespace candela::integrators::vcm
