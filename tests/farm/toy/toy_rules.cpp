#include <array>

#include "common/stages/decision.h"
#include "tests/farm/toy/chain_toy.h"
#include "tests/farm/toy/toy.h"

namespace candela {

std::span<const DecisionRule> decision_rules() {
  static constexpr std::array<DecisionRule, 2> rules{
      {{toy::kRule, &toy::double_where_squares_say_so, &toy::describe}, {"toy.step", &toy::adapt_step}}};
  return rules;
}

}  // namespace candela
