// The bytes of a checkpoint: all that a job has merged. A film; of a job of Markov chains the records of its
// chains, which are those of exactly the merged segments; accumulators and decided states where a job has
// them.
//
// The bytes of a film alone are the film's own form. With chains: "CANCHNS1"; the length of the film's form
// (u64) and that; the number of chains (u32); their records in the order of chains, each with its length
// (u32) before it; XXH64 of all before (u64). With accumulators or states: "CANSUMS1"; the length of a
// checkpoint without them (u64) and that; the number of accumulators (u32), each with its place in the plan
// (u32), half or epoch (u64) and length (u64) before its bytes; the number of states (u32), each with name
// (u16 length, bytes), epoch (u64) and SHA-256 (64 hex digits); XXH64 of all before (u64). Checkpoints of
// before there were accumulators are of the first two forms. With decisions that were folded: "CANSUMS2"; as
// "CANSUMS1" up to the states, each with its size (u64) after its hash; the number of decisions (u64); the
// bytes of the states of epochs that are not folded, each with its length (u64); the sums of the carry, each
// with its length (u64), its memo with its length (u64); XXH64 of all before (u64).
//
// The sums of the image's movement, and then a history of the error, follow any of these forms where there
// are such: bytes; their number (u64); XXH64 of bytes and number (u64); "CANMOVES" or "CANHIST1".
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "common/chains/chains.h"
#include "common/film/accumulator.h"
#include "common/film/merged_film.h"
#include "common/stages/decision.h"
#include "common/stats/movement_sums.h"

namespace candela::master {

// One for each chain; shared, for they are copied with each snapshot and never change.
using ChainRecords = std::vector<std::shared_ptr<const chains::ChainRecord>>;

// An accumulator's place in the job's plan, and the half or the epoch it is of.
using AccumulatorKey = std::pair<std::uint32_t, std::uint64_t>;
// One that a reader may hold is copied before it changes.
using Accumulators = std::map<AccumulatorKey, std::shared_ptr<film::MergedAccumulator>>;

// A state that was decided from merged sums. Its bytes are a blob of this hash.
struct DecidedState {
  std::string name;
  std::uint64_t epoch = 0;
  std::string sha256;
  std::uint64_t size_bytes = 0;  // 0: not known, from a checkpoint of the first form with states
  bool operator==(const DecidedState&) const = default;
};

// The decisions of a job of epochs. The sums of the epochs that they folded are in `carry` alone.
struct Decisions {
  std::vector<DecidedState> states;    // of epochs 0, 1, ...: those made here, then others known to the store
  std::uint64_t made = 0;              // decisions [0, made) are folded into `carry`
  std::shared_ptr<const Carry> carry;  // null: none is made
  // Bytes of the states [epochs_folded(made), made), by epoch.
  std::map<std::uint64_t, std::shared_ptr<const std::string>> bytes;
};

std::string encode_checkpoint(const film::MergedFilm& film, const ChainRecords& records,
                              const Accumulators& accumulators = {}, const Decisions& decisions = {});
// Appends the sums of the image's movement, if the job has any, to a checkpoint.
void append_movement(const stats::MovementSums& movement, std::string& checkpoint);
// Appends the history of the error to a checkpoint; what its bytes mean is nobody's affair here. After the
// movement.
void append_history(const std::string& history, std::string& checkpoint);
// The same into `out`, which is replaced; its memory is used.
void encode_checkpoint(const film::MergedFilm& film, const ChainRecords& records,
                       const Accumulators& accumulators, const Decisions& decisions, std::string& out);

struct ParsedCheckpoint {
  film::MergedFilm film;
  ChainRecords records;
  Accumulators accumulators = {};
  Decisions decisions = {};
  std::shared_ptr<const std::string> history = {};  // null: none
  stats::MovementSums movement = {};  // of the film, also if the checkpoint is of a build before
};
// The parts of a job's checkpoints beside its film.
struct CheckpointShape {
  CheckpointShape(std::uint32_t chain_count, std::vector<film::AccumulatorSpec> specs = {},  // NOLINT
                  std::optional<EpochPlan> plan = {}, double alpha = 1)
      : chains(chain_count), accumulators(std::move(specs)), epochs(std::move(plan)), movement_alpha(alpha) {}
  std::uint32_t chains;  // 0: none
  std::vector<film::AccumulatorSpec> accumulators;
  std::optional<EpochPlan> epochs;
  double movement_alpha;  // of MovementSums; 1: the job has none
};
// Fails (input) on damage, on another number of chains, where a record is not of the segments that are
// merged, on accumulators that the shape does not have, and where states and carry do not belong together.
Result<ParsedCheckpoint> parse_checkpoint(std::string_view bytes, const CheckpointShape& shape);

}  // namespace candela::master
