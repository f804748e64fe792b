// The next decision of a job of epochs, from what its film or a checkpoint holds.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/stages/epochs.h"
#include "master/merge/checkpoint.h"

namespace candela::master {

// All parts are shared and never change.
struct NextDecision {
  std::uint64_t epoch = 0;
  std::shared_ptr<const Carry> carry;
  std::shared_ptr<const std::string> previous;                       // null for epoch 0
  std::optional<std::uint64_t> folded;                               // the epoch that is to be folded
  std::shared_ptr<const std::string> folded_state;                   // null if none is
  std::vector<std::shared_ptr<const film::MergedAccumulator>> sums;  // of that epoch
};

// The epoch that the decision after `decisions` folds.
std::optional<std::uint64_t> next_folded(std::uint64_t decisions, std::uint32_t lag);
// All indices of epochs [0, count) are merged.
bool whole(const film::MergedFilm& film, const Epochs& epochs, std::uint64_t count);

// Nothing: the epoch to be folded is not whole. `specs`: all accumulators of the job.
std::optional<NextDecision> next_decision(const film::MergedFilm& film, const Accumulators& accumulators,
                                          const Decisions& decisions,
                                          std::span<const film::AccumulatorSpec> specs, const EpochPlan& plan,
                                          const Epochs& epochs);

struct MadeDecision {
  DecidedState state;
  std::string bytes;
  Carry carry;
};
// Runs the plan's rule, on a copy of the carry. Fails as decide() does.
Result<MadeDecision> make(const NextDecision& next, const EpochPlan& plan, const film::Layout& layout);

// The first difference between the decisions of an older and a newer checkpoint of one job, those included
// that can be made anew from the older one's sums; empty: none.
std::string contradiction(const ParsedCheckpoint& older, const ParsedCheckpoint& newer,
                          const CheckpointShape& shape);

}  // namespace candela::master
