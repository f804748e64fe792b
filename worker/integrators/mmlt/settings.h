#pragma once

#include "worker/integrators/chains/settings.h"
#include "worker/integrators/common_settings.h"

namespace candela::integrators {

struct MmltSettings {
  CommonSettings common{integrator_words::kMmlt};
  ChainSettings chains;
  PrimarySettings steps;
  ChainRegulariseSettings regularise;

  template <class Visitor>
  void fields(Visitor& visit) {
    common.path_fields(visit, integrator_words::kRrDepth.minimum,
                       "path depth from which Russian roulette may end a subpath; lengths are chosen before");
    chains.fields(visit, steps);
    regularise.fields(visit);
    common.plan_field(visit);
  }
};

}  // namespace candela::integrators
