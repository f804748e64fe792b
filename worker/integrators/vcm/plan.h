// Which techniques a scene needs.
#pragma once

#include "worker/integrators/plan.h"
#include "worker/integrators/vcm/techniques.h"
#include "worker/scene/features.h"
#include "worker/transport/between.h"

namespace candela::integrators::vcm {

struct Planned {
  Techniques techniques;
  transport::Between between = transport::Between::media;
  Plan plan;
};

// wanted: what the integrator would run at most.
Planned make_plan(const Techniques& wanted, const Limits& limits, bool full,
                  const scene::SceneFeatures& features);

}  // namespace candela::integrators::vcm
