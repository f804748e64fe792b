// Settings of optimis.
#pragma once

#include "worker/integrators/common_settings.h"

namespace candela::integrators {

struct OptimisSettings {
  CommonSettings common{integrator_words::kOptimis};
  NameList techniques{{"bsdf", "light"}, {"bsdf", "light", "spherical", "area", "parallel"}};
  NameList selection{{"contribution", "power"}, {"contribution", "power", "uniform", "trained"}};
  Choice light_groups{"one", {"one", "infinite", "each"}};
  Choice weights{"auto", {"auto", "optimal", "balance", "power", "cutoff", "maximum"}};
  Choice estimator{"crossfit", {"crossfit", "direct", "balance"}};
  int epoch_min = 16;
  int growth = 1;
  int lag = 1;
  Choice depth{"full", {"full", "direct"}};

  template <class Visitor>
  void fields(Visitor& visit) {
    common.path_fields(visit);
    visit("techniques", techniques,
          "techniques for direct light at the first vertex that is not specular: bsdf sampling (bsdf), and "
          "points on lights: as path samples them (light), uniform in solid angle (spherical), in area "
          "(area), in their parallel projection (parallel)");
    visit("selection", selection,
          "how a light is chosen; each choice with each way to sample points is a technique. trained: as "
          "contribution, but less often lights that shadow rays of earlier epochs found hidden; weights must "
          "be balance or another heuristic");
    visit("light_groups", light_groups,
          "groups of lights that share one alpha; every technique draws a point in each group. one: all "
          "lights; infinite: lights at infinity, and the others; each: every light, at most 8, all "
          "environments together");
    visit("weights", weights,
          "how the techniques are weighted against each other; auto: optimal, or balance if the plan expects "
          "no gain from optimal weights");
    visit("estimator", estimator,
          "with optimal weights: estimator that makes the image from the merged sums; fetch --estimator "
          "takes the others");
    visit("epoch_min", epoch_min, 2, 1 << 20,
          "selection=trained: iterations of the shortest epoch, an even number; the first epoch has an "
          "untrained selection");
    visit("growth", growth, 1, 1 << 16,
          "selection=trained: an epoch has at least 1/growth of the iterations before it");
    visit("lag", lag, 0, 64,
          "selection=trained: epochs that are rendered while the sums of earlier epochs arrive");
    visit.retired("batch", "4", "estimator=fan is gone: its image was biased");
    visit("depth", depth, "full: path tracing beyond the first vertex; direct: only direct light there");
    common.plan_field(visit);
  }
};

// At most mis::kMaxTechniques techniques; nothing that contradicts another setting.
Result<void> check(const OptimisSettings& settings);

}  // namespace candela::integrators
