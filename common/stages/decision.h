// Decisions: the state of an epoch from merged sums, by a rule with a name.
//
// A rule is a pure function of integers. Its result depends on the plan, the epoch, the states before and the
// sums of whole epochs, and on nothing else, so anybody who has the sums finds the same bytes again. The
// master decides; a test may replay it.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/film/accumulator.h"
#include "common/stages/work_plan.h"

namespace candela {

inline constexpr std::size_t kMaxStateBytes = std::size_t{1} << 30;

struct DecisionInput {
  const EpochPlan& plan;
  std::uint64_t epoch = 0;  // whose state is wanted
  std::uint32_t width = 0, height = 0;
  std::string_view previous;  // state of the epoch before; empty for epoch 0
  // The sums of an accumulator over one epoch below epochs_before(epoch, plan.lag), every unit of which is
  // merged. Null: the job has no accumulator of this name for each epoch. Valid until decide() returns.
  std::function<const film::MergedAccumulator*(std::string_view name, std::uint64_t of_epoch)> sums;
};

// Errors end the job: the rule cannot decide from sums that nobody can change.
using Decide = Result<std::string> (*)(const DecisionInput& input);

struct DecisionRule {
  std::string_view name;
  Decide decide;
};

// A program's rules. The library candela_rules defines this function alone (rules/rules.cpp); a test program
// that defines it among its own objects has rules of its own.
std::span<const DecisionRule> decision_rules();

// The rule of this name. The error (input) lists the names there are.
Result<DecisionRule> find_rule(std::string_view name);

// The state of the epoch, by the plan's rule. Fails (input) on an unknown rule, (failed) on a state that is
// too large, and as the rule fails.
Result<std::string> decide(const DecisionInput& input);

// The states of epochs [0, epochs), one after the other, from the sums alone.
Result<std::vector<std::string>> replay(const EpochPlan& plan, std::uint64_t epochs, std::uint32_t width,
                                        std::uint32_t height, const decltype(DecisionInput::sums)& sums);

}  // namespace candela
