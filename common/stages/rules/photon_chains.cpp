#include "common/stages/rules/photon_chains.h"

#include <fmt/format.h>

#include "common/adaptive/levels.h"
#include "common/stages/photon_chains.h"

namespace candela::rules {
namespace {

using photon_chains::Counts;

double share(std::uint64_t some, std::uint64_t all) {
  return all == 0 ? 0 : static_cast<double>(some) / static_cast<double>(all);
}

}  // namespace

Result<std::string> decide_photon_chains(const DecisionInput& input, Carry& carry) {
  CANDELA_ASSIGN(const double first,
                 adaptive::get_number(input.plan.constants, std::string(photon_chains::kFirstStep)));
  if (!(first >= photon_chains::kMinStep && first <= photon_chains::kMaxStep))
    return failed_error(fmt::format("the first step of the rule '{}' is out of bounds", input.plan.rule));
  const film::AccumulatorSpec spec = photon_chains::spec(input.width, input.height);
  const bool counts = !carry.sums.empty();
  if (counts && (carry.sums.size() != 1 || carry.sums[0].spec() != spec))
    return failed_error(
        fmt::format("the rule '{}' needs accumulators that are not the job's", input.plan.rule));
  if (!input.folded) return input.epoch == 0 ? photon_chains::state_of(first) : std::string(input.previous);
  if (!counts) return std::string(input.previous);
  if (input.folded->sums.size() != 1) return failed_error("the epoch to fold is of another job");
  CANDELA_TRY(carry.sums[0].merge(*input.folded->sums[0]));
  const Counts epoch = photon_chains::read(*input.folded->sums[0]);
  if (epoch.mutations == 0) return std::string(input.previous);
  CANDELA_ASSIGN(const double step, photon_chains::step_of(input.folded->state));
  return photon_chains::state_of(photon_chains::next_step(step, epoch.accepted, epoch.mutations));
}

Result<StateReport> describe_photon_chains(const EpochPlan& /*plan*/, std::uint64_t /*epoch*/,
                                           std::uint32_t /*width*/, std::uint32_t /*height*/,
                                           std::string_view state, const Carry& carry, bool /*with_layers*/) {
  StateReport report;
  if (carry.sums.empty()) return report;
  CANDELA_ASSIGN(const double step, photon_chains::step_of(state));
  report.figures.emplace_back("step size", step);
  const Counts all = photon_chains::read(carry.sums[0]);
  if (all.iterations == 0) return report;
  report.figures.emplace_back("acceptance", share(all.accepted, all.mutations));
  report.figures.emplace_back("visible fraction", share(all.visible_paths, all.light_paths));
  report.figures.emplace_back("black iterations", static_cast<double>(all.black_iterations));
  report.figures.emplace_back("flicker of an iteration", photon_chains::flicker(all));
  return report;
}

}  // namespace candela::rules
