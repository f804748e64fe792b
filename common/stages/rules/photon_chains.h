// The rule of mcppm's step sizes (common/stages/photon_chains.h). The step of an epoch follows from the step
// and the acceptance of the epoch that is newly whole. The carry has the counts of all epochs, for reports.
// Constant: `step`. A job whose pilot decided against chains has no accumulator: its step stays.
#pragma once

#include <string>

#include "common/stages/decision.h"

namespace candela::rules {

Result<std::string> decide_photon_chains(const DecisionInput& input, Carry& carry);
Result<StateReport> describe_photon_chains(const EpochPlan& plan, std::uint64_t epoch, std::uint32_t width,
                                           std::uint32_t height, std::string_view state, const Carry& carry,
                                           bool with_layers);

}  // namespace candela::rules
