// Epochs of the integrator mcppm: they count the chains of photons of whole epochs, and decide the size
// of the steps of the epochs after them. The rule `mcppm` (rules/photon_chains.h) makes the state of an
// epoch, a step size, from the acceptance of an earlier one. Any step size leaves the mean of an iteration
// exact.
//
// Counts are integers of an accumulator of the job. Its pixels are room for counts: they have nothing to do
// with the film's.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "common/film/accumulator.h"

namespace candela::photon_chains {

inline constexpr std::string_view kRule = "mcppm";  // and the name of the state
inline constexpr std::string_view kAccumulator = "mcppm.chains";
// Constant of the rule: the step size of epochs before the first decision.
inline constexpr std::string_view kFirstStep = "step";

// Counts of whole iterations. Light paths are the independent ones; those that leave photons near gather
// points are visible. An iteration without a visible path is black, and counts.
struct Counts {
  std::uint64_t iterations = 0, black_iterations = 0, light_paths = 0, visible_paths = 0, mutations = 0,
                accepted = 0;
  std::uint64_t visible_squares = 0;  // of the visible paths of each iteration
  bool operator==(const Counts&) const = default;
};
inline constexpr std::uint32_t kCounts = 7;

film::AccumulatorSpec spec(std::uint32_t width, std::uint32_t height);
// Adds counts of an iteration of this key. No other thread may add.
void add(const Counts& counts, std::uint64_t key, film::UnitAccumulator& to, std::uint32_t width,
         film::SampleCounts& sample_counts);
// Precondition: the accumulator has the spec of its film.
Counts read(const film::MergedAccumulator& sums);
// Standard deviation of the number of visible paths of an iteration over its mean: what the light of one
// iteration flickers by, in all pixels alike. 0 if fewer than two iterations or no visible path is counted.
double flicker(const Counts& counts);

// Bounds of a step size, the largest distance by which a mutation moves a random number.
inline constexpr double kMinStep = 1e-4, kMaxStep = 0.5;
// [metropolis-photons note, section 9]: step' = step exp(4 (accepted / mutations - 0.234)), within the
// bounds. Precondition: mutations > 0.
inline constexpr double kAcceptance = 0.234, kGain = 4;
double next_step(double step, std::uint64_t accepted, std::uint64_t mutations);

// The state of an epoch, and back. Fails (input) on bytes that state_of() did not write.
std::string state_of(double step);
Result<double> step_of(std::string_view state);

}  // namespace candela::photon_chains
