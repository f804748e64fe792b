#pragma once

#include "worker/integrators/adaptive/settings.h"
#include "worker/integrators/common_settings.h"
#include "worker/integrators/merging/settings.h"

namespace candela::integrators {

struct FppmSettings {
  CommonSettings common{integrator_words::kFppm};
  merging::MergeSettings merge{integrator_words::kFppm};
  adaptive::FTestSettings f_test;
  adaptive::EpochSettings epochs;

  template <class Visitor>
  void fields(Visitor& visit) {
    common.path_fields(visit);
    common.plan_field(visit);
    merge.fields(visit, false);
    f_test.fields(visit);
    visit.retired("test", "sectors", "means of nested discs lost to sums of sectors");
    visit.retired("rings", "false", "sums in rings need twice the memory of the sectors of one radius");
    visit.retired("kappa", "3", "it was of nested discs");
    epochs.fields(visit);
  }
};

}  // namespace candela::integrators
