#pragma once

#include "worker/integrators/common_settings.h"
#include "worker/integrators/merging/settings.h"

namespace candela::integrators {

struct VcmSettings {
  CommonSettings common{integrator_words::kVcm};
  merging::MergeSettings merge{integrator_words::kVcm};
  bool merge_media = false;
  Choice layers{"none", {"none", "merging"}};

  template <class Visitor>
  void fields(Visitor& visit) {
    common.path_fields(visit);
    common.plan_field(visit);
    merge.fields(visit);
    merging::no_heuristic(visit);
    visit("merge_media", merge_media, "merge in media too, inside balls; else connections cover media");
    visit("layers", layers, "further layer in the EXR: the part of the image that merging finds");
  }
};

struct BpmSettings {
  CommonSettings common{integrator_words::kBpm};
  merging::MergeSettings merge{integrator_words::kBpm};

  template <class Visitor>
  void fields(Visitor& visit) {
    common.path_fields(visit);
    common.plan_field(visit);
    merge.fields(visit);
    merging::no_heuristic(visit);
  }
};

}  // namespace candela::integrators
