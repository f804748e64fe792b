#pragma once

#include "worker/integrators/markov/settings.h"

namespace candela::integrators {

struct PssmltSettings {
  Choice over{"bdpt", {"bdpt", "path"}};
  int max_depth = -1;
  int rr_depth = 0;
  bool hide_emitters = false;
  MarkovSettings markov;
  Choice plan{"auto", {"auto", "full"}};

  int roulette() const { return rr_depth > 0 ? rr_depth : over.value == "path" ? 5 : 2; }

  template <class Visitor>
  void fields(Visitor& visit) {
    visit("over", over, "the estimator whose random numbers the chains mutate");
    visit("max_depth", max_depth, -1, 1 << 20,
          "edges of the longest path; -1 none, 1 shows emitters only, 2 adds direct light");
    visit(
        "rr_depth", rr_depth, 0, 1 << 20,
        "path depth from which Russian roulette may end a subpath; 0: what is best for bdpt (2) or path (5)");
    visit("hide_emitters", hide_emitters, "emitters do not show themselves to the camera");
    markov.fields(visit);
    visit("plan", plan, "auto leaves out what the scene does not need; full runs everything");
  }
};

}  // namespace candela::integrators
