// Decisions: the state of an epoch from merged sums, by a rule with a name.
//
// A rule is a pure function. Its result depends on the plan, the epoch, the state before, the sums of one
// whole epoch and on what the rule itself carries from the epochs before, and on nothing else. It computes
// with integers, or with + - * / sqrt of doubles (the same bits on every machine), so anybody who has the
// sums finds the same bytes again. The master decides; a test replays it (tests/replay.h).
//
//   decision e:  (state e-1, carry, sums of epoch e-1-lag)  ->  (state e, carry)
//
// Each epoch is folded once, in order, and its sums are not needed afterwards: a job of any length keeps the
// sums of lag + 1 epochs and one carry.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "common/film/accumulator.h"
#include "common/stages/work_plan.h"

namespace candela {

inline constexpr std::size_t kMaxStateBytes = std::size_t{1} << 30;

// The memory of a rule: sums and bytes of the epochs that the rule has folded, beside the state. The master
// keeps the carry, and sends it to no worker.
struct Carry {
  // One for each accumulator of the plan that is kept per epoch, in the plan's order and with its spec.
  std::vector<film::MergedAccumulator> sums;
  std::string memo;  // the rule's own bytes, such as one per pixel; empty before the first decision
};
// The carry before the first decision: zeros. `accumulators`: all of the plan.
Carry empty_carry(std::span<const film::AccumulatorSpec> accumulators, std::uint32_t width,
                  std::uint32_t height);

// Memory that a master needs for the accumulators of a job, if every pixel has sums of 64 bits: those of the
// job for each half, those of epochs for lag + 1 open epochs and the carry, whose memo counts too.
std::uint64_t statistics_bytes(const WorkPlan& plan, std::uint32_t width, std::uint32_t height);
// Fails (input) if a job of this plan needs more than a master allows.
Result<void> check_statistics(const WorkPlan& plan, const JobSettings& settings, std::uint64_t limit_bytes);

struct DecisionInput {
  const EpochPlan& plan;
  std::uint64_t epoch = 0;  // whose state is wanted
  std::uint32_t width = 0, height = 0;
  std::string_view previous;  // state of the epoch before; empty for epoch 0
  // The epoch that is newly whole, epoch - 1 - plan.lag: all its units are merged.
  struct Folded {
    std::uint64_t epoch = 0;
    std::string_view state;                            // that its units were rendered with
    std::vector<const film::MergedAccumulator*> sums;  // as Carry::sums
  };
  std::optional<Folded> folded;  // absent while epoch <= plan.lag
};

// Changes the carry in place. Errors end the job: the rule cannot decide from sums that nobody can change.
using Decide = Result<std::string> (*)(const DecisionInput& input, Carry& carry);

// A description of a state for people.
struct StateReport {
  std::vector<std::pair<std::string, double>> figures;  // such as "pixels shrunk", in order
  struct Layer {
    std::string name;           // valid as a film layer's name
    std::vector<float> values;  // width * height, row by row
  };
  std::vector<Layer> layers;  // empty unless they are asked for
};
// A pure function too. `carry`: as the decision of `state` left it.
using Describe = Result<StateReport> (*)(const EpochPlan& plan, std::uint64_t epoch, std::uint32_t width,
                                         std::uint32_t height, std::string_view state, const Carry& carry,
                                         bool with_layers);

// Bytes of the memo of one pixel.
using MemoBytes = std::uint64_t (*)(const EpochPlan& plan);

struct DecisionRule {
  std::string_view name;
  Decide decide = nullptr;
  Describe describe = nullptr;     // null: there is nothing to tell
  MemoBytes memo_bytes = nullptr;  // null: there is no memo
};

// A program's rules. The library candela_rules defines this function alone (rules/rules.cpp); a test program
// that defines it among its own objects has rules of its own.
std::span<const DecisionRule> decision_rules();

// The rule of this name. The error (input) lists the names there are.
Result<DecisionRule> find_rule(std::string_view name);

// The state of the epoch, by the plan's rule. Fails (input) on an unknown rule, (failed) on a state or memo
// that is too large, and as the rule fails; the carry is of no use then.
Result<std::string> decide(const DecisionInput& input, Carry& carry);

}  // namespace candela
