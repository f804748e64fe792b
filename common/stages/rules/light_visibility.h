// The rule of trained light selection (common/stages/light_visibility.h). It adds the counts of each whole
// epoch to the carry, and the state is the weights that follow from their sums. Constant: `entries`.
#pragma once

#include <string>

#include "common/stages/decision.h"

namespace candela::rules {

Result<std::string> decide_light_visibility(const DecisionInput& input, Carry& carry);

}  // namespace candela::rules
