// The decisions of a job of epochs again, from its sums: what a master decided, anybody finds.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/stages/decision.h"

namespace candela {

// Decisions [0, epochs), one after the other, from the sums alone.
struct Replay {
  std::vector<std::string> states;
  Carry carry;  // after the last decision
};
// The sums of a whole epoch, of an accumulator that is kept per epoch. Valid until replay() returns.
using EpochSums =
    std::function<const film::MergedAccumulator*(std::string_view name, std::uint64_t of_epoch)>;
inline Result<Replay> replay(const EpochPlan& plan, std::span<const film::AccumulatorSpec> accumulators,
                             std::uint64_t epochs, std::uint32_t width, std::uint32_t height,
                             const EpochSums& sums) {
  Replay out{{}, empty_carry(accumulators, width, height)};
  for (std::uint64_t e = 0; e < epochs; ++e) {
    DecisionInput input{plan, e, width, height, {}, {}};
    if (e > 0) input.previous = out.states.back();
    if (e > plan.lag) {
      const std::uint64_t folded = e - 1 - plan.lag;
      input.folded = {folded, out.states[folded], {}};
      for (const film::MergedAccumulator& sum : out.carry.sums)
        input.folded->sums.push_back(sums(sum.spec().name, folded));
    }
    CANDELA_ASSIGN(std::string state, decide(input, out.carry));
    out.states.push_back(std::move(state));
  }
  return out;
}

}  // namespace candela
