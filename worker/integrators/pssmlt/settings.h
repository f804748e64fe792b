#pragma once

#include <fmt/format.h>

#include "worker/integrators/chains/settings.h"
#include "worker/integrators/common_settings.h"

namespace candela::integrators {

struct PssmltSettings {
  Choice over{"bdpt", {"bdpt", "path"}};
  CommonSettings common{integrator_words::kPssmlt};
  ChainSettings chains;
  PrimarySettings steps;
  ChainRegulariseSettings regularise;

  estimators::PathOptions path_options() const {
    estimators::PathOptions options = common.path_options();
    if (common.rr_depth == 0) {
      const int depth =
          over.value == "path" ? integrator_words::kPath.rr_depth : integrator_words::kBdpt.rr_depth;
      options.rr_depth = static_cast<std::uint32_t>(depth);
    }
    return options;
  }

  template <class Visitor>
  void fields(Visitor& visit) {
    visit("over", over, "estimator whose random numbers the chains mutate");
    using namespace integrator_words;
    common.path_fields(
        visit, kPssmlt.rr_depth,
        fmt::format("path depth from which Russian roulette may end a subpath; 0: what is best for "
                    "bdpt ({}) or path ({})",
                    kBdpt.rr_depth, kPath.rr_depth));
    chains.fields(visit, steps);
    regularise.fields(visit);
    common.plan_field(visit);
  }
};

}  // namespace candela::integrators
