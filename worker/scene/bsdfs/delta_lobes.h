// All delta lobes of a closure, one after the other: mutations of paths need to know what a vertex may do,
// where walks draw one lobe of it. Who does not ask pays nothing.
#pragma once

#include <vector>

#include "worker/scene/bsdf.h"

namespace candela::scene {

// As BsdfSample has it.
struct DeltaLobe {
  Vec3 wi;
  Spectrum value;  // the fraction of light: the weight of a sample, times prob
  float prob = 1, prob_reverse = 1;
  float eta = 1;
  bool transmitted = false, passthrough = false;
};

// The delta lobes of which Closure::sample(wo, u_lobe, ...) takes one, with probabilities above 2^-24.
// Precondition: the scene prepared the closure for wo. None of a closure that belongs to a walk
// (path_edited.h), which sampling it would move.
std::vector<DeltaLobe> delta_lobes(const Closure& closure, Vec3 wo, TransportMode mode);

// For kinds of closures: values of u_lobe, one within the range of each delta lobe.
struct LobeRange {
  double begin = 0, end = 1;  // within [0, 1)
  // From a to b of it.
  LobeRange part(double a, double b) const { return {begin + (end - begin) * a, begin + (end - begin) * b}; }
};
using LobeChoices = std::vector<double>;

// The part of the range that a closure gets of its composite's. A composite hands parts of its own range to
// its parts by this function; others are asked for the lobes at both ends of their ranges.
void delta_choices(const Closure& closure, Vec3 wo, TransportMode mode, LobeRange range, LobeChoices& out);

}  // namespace candela::scene
