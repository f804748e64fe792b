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

Carry empty_carry(std::span<const film::AccumulatorSpec> accumulators, std::uint32_t width,
                  std::uint32_t height) {
  Carry carry;
  for (const film::AccumulatorSpec& spec : accumulators)
    if (spec.per == film::AccumulatorSpec::Per::epoch) carry.sums.emplace_back(width, height, spec);
  return carry;
}

std::uint64_t statistics_bytes(const WorkPlan& plan, std::uint32_t width, std::uint32_t height) {
  std::uint64_t sums = 0;
  for (const film::AccumulatorSpec& spec : plan.accumulators)
    sums += film::sums_bytes(spec, width, height) *
            (spec.per == film::AccumulatorSpec::Per::job || !plan.epochs ? 2 : plan.epochs->lag + 2);
  std::uint64_t memo = 0;
  if (plan.epochs) {
    const Result<DecisionRule> rule = find_rule(plan.epochs->rule);
    if (rule.ok() && rule->memo_bytes != nullptr) memo = rule->memo_bytes(*plan.epochs);
  }
  return sums + std::uint64_t{width} * height * memo;
}

Result<void> check_statistics(const WorkPlan& plan, const JobSettings& settings, std::uint64_t limit_bytes) {
  const std::uint64_t needed = statistics_bytes(plan, settings.width, settings.height);
  if (needed <= limit_bytes) return {};
  const auto megabytes = [](std::uint64_t bytes) { return (bytes + 999'999) / 1'000'000; };
  return input_error(
             fmt::format("the statistics of '{}' at {} x {} pixels take {} MB of the master's memory, "
                         "which allows {} MB",
                         settings.integrator, settings.width, settings.height, megabytes(needed),
                         megabytes(limit_bytes)))
      .with_mend("render a smaller image, or start the master with a larger --statistics-memory");
}

Result<std::string> decide(const DecisionInput& input, Carry& carry) {
  CANDELA_ASSIGN(const DecisionRule rule, find_rule(input.plan.rule));
  CANDELA_ASSIGN(std::string state, rule.decide(input, carry));
  if (state.size() > kMaxStateBytes || carry.memo.size() > kMaxStateBytes)
    return failed_error(
        fmt::format("the rule '{}' decided a state of {} bytes and a memo of {}, more than {}", rule.name,
                    state.size(), carry.memo.size(), kMaxStateBytes));
  return state;
}

}  // namespace candela
