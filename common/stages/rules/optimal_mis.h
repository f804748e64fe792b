// The rule of progressive optimal multiple importance sampling. Slopes of an epoch are from the sums of all
// epochs before it, and whoever reads the image can find them: units need no state, and its one byte says
// nothing. The rule folds: each whole epoch gets its corrections, which the memo adds up
// (common/stages/epoch_corrections.h), and then its sums join those that later slopes are from. Slopes know
// no lag: an epoch is folded after all before it. Constant: `counts` (common/stages/pixel_sums.h), whose
// accumulators are the job's, kept for each epoch.
#pragma once

#include <string>

#include "common/stages/decision.h"

namespace candela::rules {

Result<std::string> decide_optimal_mis(const DecisionInput& input, Carry& carry);
std::uint64_t optimal_mis_memo_bytes(const EpochPlan& plan);

}  // namespace candela::rules
