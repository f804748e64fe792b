#pragma once

#include "worker/integrators/common_settings.h"
#include "worker/integrators/merging/settings.h"

namespace candela::integrators {

struct PpmSettings {
  CommonSettings common{integrator_words::kPpm};
  merging::MergeSettings merge{integrator_words::kPpm};
  Choice photons{"all", {"all", "caustics"}};

  template <class Visitor>
  void fields(Visitor& visit) {
    common.path_fields(visit);
    common.plan_field(visit);
    merge.fields(visit);
    visit("photons", photons,
          "caustics: store and show only light that comes to a vertex from a specular vertex");
  }
};

}  // namespace candela::integrators
