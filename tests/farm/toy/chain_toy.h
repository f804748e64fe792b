// A toy of chains that learn, for tests of chains and epochs in one job. The chains are those of
// tests/unit/toy_chains.h; the state of an epoch is the length of their small steps. A table of one entry
// sums how many small steps of the epoch were proposed and accepted. The rule lengthens or shortens the step
// until a given share of the proposals is accepted.
#pragma once

#include <string>

#include "common/job/job.h"
#include "common/stages/decision.h"

namespace candela::toy {

inline constexpr const char* kChainsName = "toy-chains";
inline constexpr const char* kSmallSteps = "toy.small_steps";  // channels: proposed, accepted
inline constexpr double kTargetAcceptance = 0.7, kFirstStep = 0.02;

WorkPlan chain_work_plan(const ChainPlan& chains);
// The accepted share of an epoch's small steps; 0: there were none.
double acceptance(const film::MergedAccumulator& small_steps);
Result<std::string> adapt_step(const DecisionInput& input, Carry& carry);

}  // namespace candela::toy
