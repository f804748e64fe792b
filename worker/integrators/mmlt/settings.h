#pragma once

#include "worker/integrators/common_settings.h"
#include "worker/integrators/markov/settings.h"

namespace candela::integrators {

struct MmltSettings {
  CommonSettings common{1024};
  MarkovSettings markov;

  template <class Visitor>
  void fields(Visitor& visit) {
    common.path_fields(visit, 1,
                       "path depth from which Russian roulette may end a subpath; lengths are chosen before");
    markov.fields(visit);
    common.plan_field(visit);
  }
};

}  // namespace candela::integrators
