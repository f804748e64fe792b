// The parts that all rules of level states share.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/adaptive/levels.h"
#include "common/stages/decision.h"
#include "common/stages/epochs.h"

namespace candela::rules {

using film::Int128;

inline std::size_t pixels_of(const DecisionInput& input) {
  return std::size_t{input.width} * input.height;
}
inline int level_at(std::string_view state, std::size_t pixel) {
  return static_cast<unsigned char>(state[pixel]);
}

// Bytes of the memo: planes of one byte a pixel, which stay at 255 once they are there.
inline void count_up(char& byte) {
  auto& value = reinterpret_cast<unsigned char&>(byte);
  if (value != 255) ++value;
}

// Checks sizes and accumulators, and clears the memo of epoch 0. Fails (failed) unless the carry and the
// folded epoch have these accumulators in this order, and states and memo are of this film: `planes` of one
// byte a pixel.
Result<void> check_input(const DecisionInput& input, Carry& carry, const std::vector<std::string>& names,
                         std::size_t memo_planes, std::size_t state_planes = 1);

// The first iteration of an epoch of the plan.
std::uint64_t first_iteration(const EpochPlan& plan, std::uint64_t epoch);

// Figures: number and share of pixels above level 0, median and mean radius as a fraction of the first
// radius, then sums of the planes. Layers: "radius" as such a fraction, then the planes, by their names.
struct Plane {
  std::string figure, layer;
  std::string_view bytes;  // one a pixel
};
Result<StateReport> describe_levels(const EpochPlan& plan, std::string_view state,
                                    const std::vector<Plane>& planes, bool with_layers);

}  // namespace candela::rules
