// The decisions of a plan. Each integrator has a function
//   Planned plan(const PathOptions&, [what it would run at most,] const SceneFeatures&, bool full)
// full: leaves out only what the options do.
#pragma once

#include "worker/estimators/options.h"
#include "worker/integrators/plan.h"
#include "worker/transport/between.h"

namespace candela::integrators {

struct Planned {
  estimators::Techniques techniques;
  transport::EdgeContent between = transport::EdgeContent::media;
  Plan plan;
};

}  // namespace candela::integrators
