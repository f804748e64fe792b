#pragma once

#include "worker/integrators/common_settings.h"
#include "worker/integrators/markov/settings.h"

namespace candela::integrators {

struct PssmltSettings {
  Choice over{"bdpt", {"bdpt", "path"}};
  CommonSettings common{0};
  MarkovSettings markov;

  estimators::PathOptions path_options() const {
    estimators::PathOptions options = common.path_options();
    if (common.rr_depth == 0) options.rr_depth = over.value == "path" ? 5 : 2;
    return options;
  }

  template <class Visitor>
  void fields(Visitor& visit) {
    visit("over", over, "the estimator whose random numbers the chains mutate");
    common.path_fields(
        visit, 0,
        "path depth from which Russian roulette may end a subpath; 0: what is best for bdpt (2) or "
        "path (5)");
    markov.fields(visit);
    common.plan_field(visit);
  }
};

}  // namespace candela::integrators
