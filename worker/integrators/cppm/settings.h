#pragma once

#include "worker/integrators/adaptive/settings.h"
#include "worker/integrators/common_settings.h"
#include "worker/integrators/merging/settings.h"

namespace candela::integrators {

struct CppmSettings {
  CommonSettings common{integrator_words::kCppm};
  merging::MergeSettings merge{integrator_words::kCppm};
  adaptive::CountTestSettings test;
  adaptive::EpochSettings epochs;

  template <class Visitor>
  void fields(Visitor& visit) {
    common.path_fields(visit);
    common.plan_field(visit);
    merge.fields(visit, false);
    test.fields(visit);
    epochs.fields(visit);
  }
};

}  // namespace candela::integrators
