#pragma once

#include "worker/integrators/common_settings.h"
#include "worker/integrators/regularise.h"

namespace candela::integrators {

struct BdptSettings {
  CommonSettings common{integrator_words::kBdpt};
  Choice heuristic{"balance", {"balance", "power", "maximum", "cutoff"}};
  Choice layers{"none", {"none", "weighted", "unweighted", "both"}};
  int layer_depth = 4;
  RegulariseSettings regularise;

  template <class Visitor>
  void fields(Visitor& visit) {
    common.path_fields(visit, integrator_words::kRrDepth.minimum,
                       "path depth from which Russian roulette may end a subpath");
    visit("heuristic", heuristic, "how the techniques that can make a path are weighted against each other");
    visit(
        "layers", layers,
        "further layers in the EXR, one for each technique of s vertices from the light and t from the eye");
    visit("layer_depth", layer_depth, 1, 9, "edges of the longest paths that have layers of their own");
    regularise.fields(visit);
    common.plan_field(visit);
  }
};

}  // namespace candela::integrators
