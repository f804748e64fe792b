// Settings of the path tracer, as Mitsuba names and means them.
#pragma once

#include "worker/integrators/common_settings.h"

namespace candela::integrators {

struct PathSettings {
  CommonSettings common{integrator_words::kPath};
  Choice heuristic{"power", {"power", "balance"}};

  template <class Visitor>
  void fields(Visitor& visit) {
    common.path_fields(visit);
    visit("heuristic", heuristic,
          "how next event estimation and bsdf sampling are weighted against each other");
    common.plan_field(visit);
  }
};

}  // namespace candela::integrators
