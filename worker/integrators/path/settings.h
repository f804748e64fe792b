// Settings of the path tracer, as Mitsuba names and means them.
#pragma once

#include "worker/integrators/common_settings.h"
#include "worker/integrators/regularise.h"

namespace candela::integrators {

struct PathSettings {
  CommonSettings common{integrator_words::kPath};
  Choice heuristic{"power", {"power", "balance"}};
  RegulariseSettings regularise;

  template <class Visitor>
  void fields(Visitor& visit) {
    common.path_fields(visit);
    visit("heuristic", heuristic,
          "how next event estimation and bsdf sampling are weighted against each other");
    regularise.fields(visit);
    common.plan_field(visit);
  }
};

}  // namespace candela::integrators
