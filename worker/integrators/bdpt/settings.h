#pragma once

#include "worker/integrators/settings.h"

namespace candela::integrators {

struct BdptSettings {
  int max_depth = -1;
  int rr_depth = 2;
  bool hide_emitters = false;
  Choice heuristic{"balance", {"balance", "power", "maximum", "cutoff"}};
  Choice layers{"none", {"none", "weighted", "unweighted", "both"}};
  int layer_depth = 4;
  Choice plan{"auto", {"auto", "full"}};

  template <class Visitor>
  void fields(Visitor& visit) {
    visit("max_depth", max_depth, -1, 1 << 20,
          "edges of the longest path; -1 none, 1 shows emitters only, 2 adds direct light");
    visit("rr_depth", rr_depth, 1, 1 << 20, "path depth from which Russian roulette may end a subpath");
    visit("hide_emitters", hide_emitters, "emitters do not show themselves to the camera");
    visit("heuristic", heuristic, "how the techniques that can make a path are weighted against each other");
    visit(
        "layers", layers,
        "further layers in the EXR, one for each technique of s vertices from the light and t from the eye");
    visit("layer_depth", layer_depth, 1, 9, "edges of the longest paths that have layers of their own");
    visit("plan", plan, "auto leaves out what the scene does not need; full runs everything");
  }
};

}  // namespace candela::integrators
