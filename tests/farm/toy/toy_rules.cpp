#include <array>

#include "common/stages/decision.h"
#include "tests/farm/toy/toy.h"

namespace candela {

std::span<const DecisionRule> decision_rules() {
  static constexpr std::array<DecisionRule, 1> rules{
      {{toy::kRule, &toy::double_where_squares_say_so, &toy::describe}}};
  return rules;
}

}  // namespace candela
