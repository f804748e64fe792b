// The rules of the programs. No integrator of the product has epochs.
#include "common/stages/decision.h"

namespace candela {

std::span<const DecisionRule> decision_rules() {
  return {};
}

}  // namespace candela
