#pragma once

#include "worker/integrators/adaptive/settings.h"
#include "worker/integrators/common_settings.h"
#include "worker/integrators/merging/settings.h"

namespace candela::integrators {

struct AppmSettings {
  CommonSettings common{integrator_words::kAppm};
  merging::MergeSettings merge{integrator_words::kAppm};
  adaptive::PlugInSettings bandwidth;
  adaptive::EpochSettings epochs;

  template <class Visitor>
  void fields(Visitor& visit) {
    common.path_fields(visit);
    common.plan_field(visit);
    merge.fields(visit, false);
    bandwidth.fields(visit);
    epochs.fields(visit);
  }
};

}  // namespace candela::integrators
