// From a sample's value to a film's integers. Every contribution is quantised once, with the job's scale.
//
// Rounding is stochastic and unbiased: floor(value * 2^log2 + u), u uniform in [0,1) from a hash of the
// sample's key, so E[tally] = value * 2^log2 exactly, however small the value, and the result depends on the
// sample alone.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>

#include "common/rng/stream.h"

namespace candela::film {

// One contribution may be at most this many film units; beyond it is `saturated`.
inline constexpr double kMaxContribution = 0x1p56;

// Three numbers uniform in [0, 1) of 52 bits each from a sample's key. The word is not one that rng::Stream
// draws from the same key: a dither that depended on the sampled path would bias the rounding. The channels
// share the word, which correlates their rounding errors (each below one film unit) and biases none.
inline double dither(std::uint64_t word, int channel) {
  const std::uint64_t bits = std::rotl(word, 21 * channel);
  return std::bit_cast<double>((bits >> 12) | 0x3ff0000000000000ULL) - 1.0;
}
inline std::uint64_t dither_word(std::uint64_t key) {
  return rng::mix64(key ^ 0xd1b54a32d192ed03ULL);
}

// Quantises a finite value (negative allowed: filters with lobes). `uniform` is in [0, 1).
inline std::int64_t quantise(double value, double units_per_value, double uniform) {
  return static_cast<std::int64_t>(std::floor(value * units_per_value + uniform));
}

}  // namespace candela::film
