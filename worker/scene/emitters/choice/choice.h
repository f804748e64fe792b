// Choosing one emitter of many for a reference point. A chooser has
//   bool choose(p, front, u, EmitterChoice&)   false: no emitter it would choose can light the point
//   float prob(p, front, emitter)              the discrete probability of that choice
// with u in [0, 1) and `front` as in Scene::sample_direct. Choosers know nothing of points on emitters.
#pragma once

#include <cstdint>

#include "worker/scene/hit.h"

namespace candela::scene {

struct EmitterChoice {
  std::uint32_t emitter = kNone;
  float prob = 0;
  double rest = 0;  // what is left of u, uniform in [0, 1) again
};

// The probability of a candidate of this importance: a part of the choice goes evenly to all candidates that
// are possible, the rest in proportion.
inline float mixed_share(float even, float importance, float sum, std::uint32_t positive_count) {
  if (!(importance > 0)) return 0;
  return (1 - even) * (importance / sum) + even / static_cast<float>(positive_count);
}

}  // namespace candela::scene
