// The developments of the programs.
#include <array>

#include "common/stages/developments/optimal_mis.h"

namespace candela {

std::span<const DevelopmentRule> developments() {
  static constexpr std::array<DevelopmentRule, 1> rules{{
      {optimal_mis::kName, optimal_mis::kEstimators, &optimal_mis::validate_plan, &optimal_mis::correct},
  }};
  return rules;
}

}  // namespace candela
