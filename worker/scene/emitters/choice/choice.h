// Choosing one emitter of many for a reference point. A chooser has
//   bool choose(p, front, u, EmitterChoice&)   false: no emitter it would choose can light the point
//   float prob(p, front, emitter)              the discrete probability of that choice
// with u in [0, 1) and `front` as in Scene::sample_direct. Choosers know nothing of points on emitters.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>

#include "worker/scene/hit.h"

namespace candela::scene {

// Weights by group of emitters; an emitter of weight 0 is not chosen. Each emitter is a group, or there is a
// light tree, and of_nodes follows from of_groups (TreeChooser::node_weights).
struct ChoiceWeights {
  std::span<const std::uint8_t> of_groups;
  std::span<const float> of_nodes = {};
};

struct EmitterChoice {
  std::uint32_t emitter = kNone;
  float prob = 0;
  double rest = 0;  // what is left of u, uniform in [0, 1) again
};

// A candidate of a choice: what it is expected to give, and its part of what is shared out evenly among the
// candidates that are possible, 1 for most.
struct Candidate {
  float importance, even;  // not set by themselves: arrays of candidates are filled one by one
};

// A part of the choice, `even`, goes evenly to all candidates that are possible, the rest in proportion to
// importance.
struct CandidateSum {
  float importance = 0, even = 0;

  void add(Candidate c) {
    importance += c.importance;
    even += c.even;
  }
  float share(Candidate c, float even_part) const {
    if (!(c.importance > 0)) return 0;
    return (1 - even_part) * (c.importance / importance) + even_part * (c.even / even);
  }
};

inline Candidate candidate(float importance) {
  return {importance, importance > 0 ? 1.0f : 0.0f};
}
// An environment beside emitters that have a place or a direction, `others` in sum. A path finds the
// environment by itself, by the direction that it goes on in, and finds a smooth one without much noise; no
// other emitter is found so well. Let r be the importance of the others over that of the environment, and q
// their part of the choice. A choice adds (1 / q - 1) r^2 to the variance; samples of the environment take
// about `variation` q from it. The sum is smallest near q = r^2 / (r^2 + variation). (variation: see
// Environment.) In proportion where that is more.
inline Candidate environment_candidate(float importance, float variation, float others) {
  if (!(others > 0)) return candidate(importance);
  const float part = std::min(1.0f, variation * importance / others);
  return {importance * part, importance > 0 ? std::min(1.0f, variation) : 0.0f};
}

}  // namespace candela::scene
