#include "common/stages/development.h"

#include <fmt/format.h>

#include <algorithm>

namespace candela {
namespace {

const DevelopmentRule* rule_named(std::string_view name) {
  for (const DevelopmentRule& rule : developments())
    if (rule.name == name) return &rule;
  return nullptr;
}

bool offers(const DevelopmentRule& rule, std::string_view estimator) {
  return std::find(rule.estimators.begin(), rule.estimators.end(), estimator) != rule.estimators.end();
}

}  // namespace

std::string_view default_estimator(const DevelopmentPlan& plan) {
  const auto found = plan.constants.find("estimator");
  return found == plan.constants.end() ? std::string_view() : std::string_view(found->second);
}

Result<void> check_development(const WorkPlan& plan) {
  if (!plan.development) return {};
  const DevelopmentRule* rule = rule_named(plan.development->name);
  if (rule == nullptr)
    return input_error(fmt::format("there is no development '{}'", plan.development->name))
        .with_field("work.development.name");
  if (const std::string_view estimator = default_estimator(*plan.development); !offers(*rule, estimator))
    return input_error(fmt::format("the development '{}' has no estimator '{}'", rule->name, estimator))
        .with_field("work.development.constants");
  return rule->validate(plan);
}

Result<Corrections> correct(DevelopmentInput input) {
  const DevelopmentRule* rule = rule_named(input.plan.name);
  if (rule == nullptr) return input_error(fmt::format("there is no development '{}'", input.plan.name));
  if (input.estimator.empty()) input.estimator = default_estimator(input.plan);
  if (offers(*rule, input.estimator)) return rule->correct(input);
  std::string names;
  for (const std::string_view name : rule->estimators)
    names += (names.empty() ? "" : ", ") + std::string(name);
  return usage_error(fmt::format("the job has no estimator '{}'", input.estimator))
      .with_field("estimator")
      .with_mend("there is " + names);
}

}  // namespace candela
