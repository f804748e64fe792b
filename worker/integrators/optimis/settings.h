// Settings of optimis.
#pragma once

#include "worker/integrators/common_settings.h"

namespace candela::integrators {

struct OptimisSettings {
  CommonSettings common{integrator_words::kOptimis};
  NameList techniques{{"bsdf", "light"}, {"bsdf", "light", "spherical", "area", "parallel"}};
  NameList selection{{"contribution", "power"}, {"contribution", "power", "uniform", "trained"}};
  Choice light_groups{"one", {"one", "infinite", "each"}};
  Choice weights{"auto", {"auto", "optimal", "balance", "power", "cutoff", "maximum", "best"}};
  Choice estimator{"crossfit", {"crossfit", "direct", "balance", "progressive", "fan"}};
  int epoch_min = 16;
  int growth = 1;
  int lag = 1;
  int batch = 4;
  Choice depth{"full", {"full", "direct"}};

  template <class Visitor>
  void fields(Visitor& visit) {
    common.path_fields(visit);
    visit("techniques", techniques,
          "direct light at the first vertex that is not specular: by bsdf sampling, and by points on lights, "
          "as path samples them (light), uniform in solid angle, in area, in their parallel projection");
    visit("selection", selection,
          "how the light of a point is chosen; each with each way of sampling points is a technique. "
          "trained: as "
          "contribution, less where shadow rays of earlier epochs found lights hidden, and as contribution "
          "if the "
          "first epoch found few hidden; weights are balance or another heuristic");
    visit(
        "light_groups", light_groups,
        "groups of lights that share one alpha, and of each of which every technique draws a point: one, all "
        "lights; infinite, lights that are infinitely far away apart from the others; each, every light, of "
        "at most 8, all environments together");
    visit("weights", weights,
          "how the techniques are weighted against each other; auto: optimal, or balance if the plan expects "
          "no "
          "gain from optimal weights");
    visit("estimator", estimator,
          "with optimal weights: estimator that makes the image from the merged sums; fetch --estimator "
          "takes the others");
    visit("epoch_min", epoch_min, 2, 1 << 20,
          "estimator=progressive or selection=trained: iterations of the shortest epoch, an even number; the "
          "first epoch has the weights of the balance heuristic, and an untrained selection");
    visit("growth", growth, 1, 1 << 16,
          "estimator=progressive or selection=trained: an epoch has at least 1/growth of the iterations "
          "before it");
    visit("lag", lag, 0, 64,
          "estimator=progressive or selection=trained: epochs that are rendered while the sums of those "
          "before arrive");
    visit("batch", batch, 2, 64, "estimator=fan: paths of a pixel in one iteration, solved for together");
    visit("depth", depth, "full: beyond the first vertex by path tracing; direct: direct light there alone");
    common.plan_field(visit);
  }
};

// At most mis::kMaxTechniques techniques; nothing that contradicts another setting.
Result<void> check(const OptimisSettings& settings);

}  // namespace candela::integrators
