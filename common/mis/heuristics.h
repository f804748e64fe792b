// Weights of multiple importance sampling that look at the densities alone [Veach 1997, Ch. 9].
//
// p_i  density of technique i at a point, all in one measure
// n_i  samples of technique i in a batch; q_i = n_i p_i
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace candela::mis {

inline constexpr std::size_t kMaxTechniques = 8;

// Samples of each technique in one batch.
struct Allocation {
  std::size_t techniques = 0;
  std::array<double, kMaxTechniques> counts{};  // n_i >= 1
  double total() const {                        // M
    double sum = 0;
    for (std::size_t i = 0; i < techniques; ++i) sum += counts[i];
    return sum;
  }
  static Allocation ones(std::size_t techniques) {
    Allocation a{techniques, {}};
    for (std::size_t i = 0; i < techniques; ++i) a.counts[i] = 1;
    return a;
  }
};

enum class Heuristic : std::uint8_t { balance, power, cutoff, maximum };
struct HeuristicName {
  std::string_view name;
  Heuristic heuristic;
};
inline constexpr std::array<HeuristicName, 4> kHeuristics = {{{"balance", Heuristic::balance},
                                                              {"power", Heuristic::power},
                                                              {"cutoff", Heuristic::cutoff},
                                                              {"maximum", Heuristic::maximum}}};

inline constexpr double kCutoff = 0.1;  // tau: techniques below this share of the largest q_i are left out

// Fills weights[i] = w_i, which sum to 1. Techniques of equal q_i share the maximum. The densities are
// divided by the largest, so that neither their size nor their measure matters. Precondition: some density is
// > 0.
inline void weights(Heuristic heuristic, const Allocation& allocation, std::span<const double> densities,
                    std::span<double> weights) {
  double largest = 0;
  for (std::size_t i = 0; i < allocation.techniques; ++i)
    largest = std::max(largest, allocation.counts[i] * densities[i]);
  double sum = 0;
  for (std::size_t i = 0; i < allocation.techniques; ++i) {
    const double share = allocation.counts[i] * densities[i] / largest;
    double w = share;
    if (heuristic == Heuristic::power) w = share * share;
    if (heuristic == Heuristic::cutoff) w = share < kCutoff ? 0 : share;
    if (heuristic == Heuristic::maximum) w = share == 1 ? 1 : 0;
    weights[i] = w;
    sum += w;
  }
  for (std::size_t i = 0; i < allocation.techniques; ++i) weights[i] /= sum;
}

}  // namespace candela::mis
