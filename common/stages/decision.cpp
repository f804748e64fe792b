#include "common/stages/decision.h"

#include <fmt/format.h>

namespace candela {

Result<DecisionRule> find_rule(std::string_view name) {
  std::string names;
  for (const DecisionRule& rule : decision_rules()) {
    if (rule.name == name) return rule;
    names += (names.empty() ? "" : ", ") + std::string(rule.name);
  }
  return input_error(
             fmt::format("there is no decision rule '{}'; rules: {}", name, names.empty() ? "none" : names))
      .with_field("work.epochs.rule");
}

Result<std::string> decide(const DecisionInput& input) {
  CANDELA_ASSIGN(const DecisionRule rule, find_rule(input.plan.rule));
  CANDELA_ASSIGN(std::string state, rule.decide(input));
  if (state.size() > kMaxStateBytes)
    return failed_error(fmt::format("the rule '{}' decided a state of {} bytes, more than {}", rule.name,
                                    state.size(), kMaxStateBytes));
  return state;
}

Result<std::vector<std::string>> replay(const EpochPlan& plan, std::uint64_t epochs, std::uint32_t width,
                                        std::uint32_t height, const decltype(DecisionInput::sums)& sums) {
  std::vector<std::string> states;
  for (std::uint64_t e = 0; e < epochs; ++e) {
    const std::string_view previous = states.empty() ? std::string_view() : states.back();
    CANDELA_ASSIGN(std::string state, decide({plan, e, width, height, previous, sums}));
    states.push_back(std::move(state));
  }
  return states;
}

}  // namespace candela
