// The best technique of a pixel: weight 1 for the technique of least variance, 0 for all others [Kondapaneni
// 2019, supplement, Fig. 1].
//
// v_i  the estimate of one batch by technique i alone: f / p_i of its sample
//
// The technique is chosen from sums of other samples than those it is applied to, so that the image is
// unbiased. A technique is eligible if it covers the support of f: only then is v_i without bias.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "common/mis/sums.h"

namespace candela::mis {

// Sums over batches.
struct Singles {
  std::array<Color, kMaxTechniques> single{};  // of v_i
  Vector squares{};                            // of v_i^2, over all colors
  Color balance{};                             // of the balance heuristic's estimates from the same samples
  double batches = 0;

  void add(const Singles& other) {
    for (std::size_t i = 0; i < kMaxTechniques; ++i) {
      squares[i] += other.squares[i];
      for (std::size_t k = 0; k < kColors; ++k) single[i][k] += other.single[i][k];
    }
    for (std::size_t k = 0; k < kColors; ++k) balance[k] += other.balance[k];
    batches += other.batches;
  }
};

// Bit i: technique i covers the support of f.
using Eligible = std::uint32_t;
static_assert(kMaxTechniques <= 32);

// The eligible technique of least mean squared distance from the balance heuristic's mean, the first of equal
// ones; nothing without a batch. The distance is from one mean for all techniques: a technique that rarely
// finds light, and has found none yet, has the variance zero, but not that distance.
inline std::optional<std::size_t> best_technique(std::size_t techniques, Eligible eligible,
                                                 const Singles& sums) {
  if (!(sums.batches > 0)) return std::nullopt;
  std::optional<std::size_t> best;
  double least = 0;
  for (std::size_t i = 0; i < techniques; ++i) {
    if ((eligible >> i & 1) == 0) continue;
    double distance = sums.squares[i];  // but for what all techniques have in common
    for (std::size_t k = 0; k < kColors; ++k)
      distance -= 2 * sums.single[i][k] * (sums.balance[k] / sums.batches);
    if (best && !(distance < least)) continue;
    best = i;
    least = distance;
  }
  return best;
}

// Adds to the sum of the balance heuristic's estimates what makes it the sum of the technique's.
inline Color single_correction(const Singles& sums, std::optional<std::size_t> technique) {
  Color out{};
  if (!technique) return out;
  for (std::size_t k = 0; k < kColors; ++k) out[k] = sums.single[*technique][k] - sums.balance[k];
  return out;
}

}  // namespace candela::mis
