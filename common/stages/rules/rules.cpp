// The rules of the programs.
#include <array>

#include "common/stages/decision.h"
#include "common/stages/rules/radius_rules.h"

namespace candela {

std::span<const DecisionRule> decision_rules() {
  static constexpr std::array<DecisionRule, 3> rules{{
      {"fppm", &rules::decide_fppm, &rules::describe_fppm},
      {"cppm", &rules::decide_cppm, &rules::describe_cppm},
      {"appm", &rules::decide_appm, &rules::describe_appm},
  }};
  return rules;
}

}  // namespace candela
