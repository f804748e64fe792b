#pragma once

#include "worker/integrators/common_settings.h"
#include "worker/integrators/markov/settings.h"

namespace candela::integrators {

struct MmltSettings {
  CommonSettings common{integrator_words::kMmlt};
  MarkovSettings markov;

  template <class Visitor>
  void fields(Visitor& visit) {
    common.path_fields(visit, integrator_words::kRrDepth.minimum,
                       "path depth from which Russian roulette may end a subpath; lengths are chosen before");
    markov.fields(visit);
    common.plan_field(visit);
  }
};

}  // namespace candela::integrators
