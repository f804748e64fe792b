#pragma once

#include "worker/integrators/settings.h"

namespace candela::integrators {

struct LightSettings {
  int max_depth = -1;
  int rr_depth = 2;
  bool hide_emitters = false;
  Choice plan{"auto", {"auto", "full"}};

  template <class Visitor>
  void fields(Visitor& visit) {
    visit("max_depth", max_depth, -1, 1 << 20,
          "edges of the longest path; -1 none, 1 shows emitters only, 2 adds direct light");
    visit("rr_depth", rr_depth, 1, 1 << 20, "path depth from which Russian roulette may end a path");
    visit("hide_emitters", hide_emitters, "emitters do not show themselves to the camera");
    visit("plan", plan, "auto leaves out what the scene does not need; full runs everything");
  }
};

}  // namespace candela::integrators
