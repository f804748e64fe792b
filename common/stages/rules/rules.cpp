// The rules of the programs.
#include <array>

#include "common/stages/decision.h"
#include "common/stages/light_visibility.h"
#include "common/stages/photon_chains.h"
#include "common/stages/rules/light_visibility.h"
#include "common/stages/rules/photon_chains.h"
#include "common/stages/rules/radius_rules.h"

namespace candela {

std::span<const DecisionRule> decision_rules() {
  static constexpr std::array<DecisionRule, 5> rules{{
      {"fppm", &rules::decide_fppm, &rules::describe_fppm, &rules::fppm_memo_bytes},
      {"cppm", &rules::decide_cppm, &rules::describe_cppm, &rules::cppm_memo_bytes},
      {"appm", &rules::decide_appm, &rules::describe_appm},
      {light_visibility::kRule, &rules::decide_light_visibility},
      {photon_chains::kRule, &rules::decide_photon_chains, &rules::describe_photon_chains},
  }};
  return rules;
}

}  // namespace candela
