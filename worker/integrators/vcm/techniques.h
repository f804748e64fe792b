// What the kernel runs, and within which limits.
#pragma once

#include <cstdint>

#include "worker/integrators/merging/rules.h"

namespace candela::integrators::vcm {

// What the plan decided.
struct Techniques {
  bool light_paths = true, eye_paths = true;
  bool hit_light = true, next_event = true, connect = true, light_image = true, hit_lens = true;
  bool merge_surface = true, merge_medium = true;
  bool merges() const { return merge_surface || merge_medium; }
  bool needs_light_paths() const { return connect || light_image || hit_lens || merges(); }
  static Techniques none() { return {false, false, false, false, false, false, false, false, false}; }
};

struct Limits {
  std::uint32_t max_depth = 0, rr_depth = 2;
  bool hide_emitters = false;
  bool choose_emitter = true;
  merging::MergeRules merge;
};

}  // namespace candela::integrators::vcm
