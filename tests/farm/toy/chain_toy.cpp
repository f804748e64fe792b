#include "tests/farm/toy/chain_toy.h"

#include <algorithm>
#include <cstring>

namespace candela::toy {
namespace {

using film::AccumulatorSpec;

constexpr std::uint32_t kRounds = 3;  // in the first epoch: a border lies amid a round
constexpr double kShortest = 1e-4, kLongest = 0.5;

std::string bytes_of(double step) {
  std::string bytes(sizeof step, '\0');
  std::memcpy(bytes.data(), &step, sizeof step);
  return bytes;
}

}  // namespace

WorkPlan chain_work_plan(const ChainPlan& chains) {
  WorkPlan plan;
  plan.layers = {"independent", "segments"};
  plan.chains = chains;
  plan.accumulators = {{kSmallSteps, 2, 0, AccumulatorSpec::Per::epoch, AccumulatorSpec::Domain::table, 1}};
  plan.epochs = EpochPlan{kRounds * chains.chains - 6, 4, 1, "toy.step", {}};
  return plan;
}

double acceptance(const film::MergedAccumulator& small_steps) {
  const auto proposed = static_cast<double>(small_steps.sum(0, 0, 0)),
             accepted = static_cast<double>(small_steps.sum(0, 0, 1));
  return proposed > 0 ? accepted / proposed : 0;
}

Result<std::string> adapt_step(const DecisionInput& input, Carry& carry) {
  if (carry.sums.size() != 1) return failed_error("there are no counts of small steps");
  if (input.epoch == 0) return bytes_of(kFirstStep);
  if (input.previous.size() != sizeof(double)) return failed_error("the state before is no step");
  if (!input.folded) return std::string(input.previous);
  double step = 0;
  if (input.folded->state.size() != sizeof step) return failed_error("the state of an epoch is no step");
  std::memcpy(&step, input.folded->state.data(), sizeof step);
  const double ratio = acceptance(*input.folded->sums[0]) / kTargetAcceptance;
  return bytes_of(std::clamp(step * std::clamp(ratio * ratio, 0.25, 4.0), kShortest, kLongest));
}

}  // namespace candela::toy
