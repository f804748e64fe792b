#pragma once

#include "worker/integrators/common_settings.h"

namespace candela::integrators {

struct LightSettings {
  CommonSettings common{integrator_words::kLight};

  template <class Visitor>
  void fields(Visitor& visit) {
    common.path_fields(visit);
    common.plan_field(visit);
  }
};

}  // namespace candela::integrators
