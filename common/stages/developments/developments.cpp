// The developments of the programs.
#include <array>

#include "common/stages/developments/best_technique.h"
#include "common/stages/developments/optimal_mis.h"

namespace candela {

std::span<const DevelopmentRule> developments() {
  static constexpr std::array<DevelopmentRule, 3> rules{{
      {optimal_mis::kName, optimal_mis::kEstimators, &optimal_mis::validate_plan, &optimal_mis::correct},
      {optimal_mis::kEpochName, optimal_mis::kEpochEstimators, &optimal_mis::validate_epoch_plan,
       &optimal_mis::correct_epochs},
      {best_technique::kName, best_technique::kEstimators, &best_technique::validate_plan,
       &best_technique::correct},
  }};
  return rules;
}

}  // namespace candela
