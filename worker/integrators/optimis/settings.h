// Settings of optimis.
#pragma once

#include "worker/integrators/common_settings.h"

namespace candela::integrators {

struct OptimisSettings {
  CommonSettings common{integrator_words::kOptimis};
  NameList techniques{{"bsdf", "light"}, {"bsdf", "light"}};
  NameList selection{{"contribution", "power"}, {"contribution", "power", "uniform"}};
  Choice weights{"optimal", {"optimal", "balance", "power", "cutoff", "maximum"}};
  Choice estimator{"crossfit", {"crossfit", "direct", "balance"}};
  Choice depth{"full", {"full", "direct"}};

  template <class Visitor>
  void fields(Visitor& visit) {
    common.path_fields(visit);
    visit("techniques", techniques,
          "direct light at the first vertex that is not specular: by bsdf sampling, by points on lights");
    visit("selection", selection, "how the light of a point is chosen; each is a technique");
    visit("weights", weights, "how the techniques are weighted against each other");
    visit("estimator", estimator,
          "of optimal weights: what the image is read by; fetch --estimator has the others");
    visit("depth", depth, "full: beyond the first vertex by path tracing; direct: direct light there alone");
    common.plan_field(visit);
  }
};

}  // namespace candela::integrators
