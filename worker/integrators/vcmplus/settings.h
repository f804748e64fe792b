#pragma once

#include "worker/integrators/adaptive/settings.h"
#include "worker/integrators/common_settings.h"
#include "worker/integrators/merging/settings.h"

namespace candela::integrators {

struct VcmplusSettings {
  CommonSettings common{integrator_words::kVcmplus};
  merging::MergeSettings merge{integrator_words::kVcmplus};
  bool merge_media = false;
  Choice layers{"none", {"none", "merging"}};
  // A radius that is rejected wrongly costs less than in fppm: connections find what merging loses.
  adaptive::FTestSettings f_test{.alpha_f = 0.05};
  adaptive::EpochSettings epochs;

  template <class Visitor>
  void fields(Visitor& visit) {
    common.path_fields(visit);
    common.plan_field(visit);
    merge.fields(visit);
    merging::no_heuristic(visit);
    visit("merge_media", merge_media, "merge in media too, inside balls; else connections cover media");
    visit("layers", layers, "further layer in the EXR: the part of the image that merging finds");
    f_test.fields(visit);
    visit.retired("test", "sectors", "sums of opposite sectors lost to those of all sectors");
    epochs.fields(visit);
  }
};

}  // namespace candela::integrators
