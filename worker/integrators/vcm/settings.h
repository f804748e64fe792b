#pragma once

#include "worker/integrators/common_settings.h"
#include "worker/integrators/merging/settings.h"

namespace candela::integrators {

struct VcmSettings {
  CommonSettings common;
  merging::MergeSettings merge;
  Choice heuristic{"balance", {"balance", "power"}};
  bool merge_media = false;

  // Merging carries less of the image than in ppm: its bias matters less, its variance as much.
  VcmSettings() { merge.alpha = 0.75; }

  template <class Visitor>
  void fields(Visitor& visit) {
    common.path_fields(visit);
    common.plan_field(visit);
    merge.fields(visit);
    visit("heuristic", heuristic, "how the techniques are weighted against each other");
    visit("merge_media", merge_media, "merge in media too, with balls; connections cover media without");
  }
};

struct BpmSettings {
  CommonSettings common;
  merging::MergeSettings merge;
  Choice heuristic{"balance", {"balance", "power"}};

  template <class Visitor>
  void fields(Visitor& visit) {
    common.path_fields(visit);
    common.plan_field(visit);
    merge.fields(visit);
    visit("heuristic", heuristic, "how merges at different vertices are weighted against each other");
  }
};

}  // namespace candela::integrators
