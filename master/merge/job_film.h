// All that one job has merged, with its checkpoints: the film, of a job of Markov chains the records of its
// chains, and accumulators. They change together, under one lock and in one file.
//
// A checkpoint is a file film.<generation>.ckpt, made visible atomically, that holds the sums and the exact
// set of merged indices (checkpoint.h). The generation before is kept until the next one is on disk, and
// serves where the newest cannot be read. The lock is held for merging and for copying only, never across
// compression or I/O.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/mutex.h"
#include "common/base/result.h"
#include "common/film/delta.h"
#include "common/film/merged_film.h"
#include "common/stages/epochs.h"
#include "common/stages/prefixes.h"
#include "master/merge/checkpoint.h"
#include "master/merge/decisions.h"

namespace candela::master {

// Writes a whole file or leaves the old one (write_file_atomically; tests inject failures).
using FileWriter = std::function<Result<void>(const std::filesystem::path&, std::string_view)>;

class JobFilm {
 public:
  // `shape`: what there is beside the film.
  JobFilm(std::filesystem::path folder, film::Layout layout, int scale_log2, FileWriter writer,
          CheckpointShape shape = 0);

  // Reads the newest checkpoint that is whole and of this layout and scale; an empty film if there is none. A
  // damaged generation is renamed to film.N.ckpt.damaged, so that it takes no place among the two that are
  // kept. No effect if the film is loaded already. Errors: a lack of memory or of file descriptors, which
  // says nothing of the files.
  struct Loading {
    bool read = false;    // by this call
    std::string trouble;  // what is to be told about damaged generations; empty: nothing
  };
  Result<Loading> ensure_loaded();
  // Reads the checkpoints that are on disk, loaded or not, and sets damaged ones aside. If the newest was
  // damaged and the film is loaded, the film is dirty again.
  // Two whole generations of a job of epochs are compared: the decisions of the older one, and those that can
  // be made anew from its sums, must be those of the newer one.
  struct Verified {
    std::string damage;         // empty: none
    std::string contradiction;  // of decisions between the generations; empty: none
  };
  Result<Verified> verify_files();
  // One thread at a time agrees the film with the ledger (Farm::open_film).
  Mutex& opening() CANDELA_THREAD_SAFETY(lock_returned(opening_mutex_)) { return opening_mutex_; }
  bool loaded() const;
  // Gives the memory back, if everything merged is on disk and the film is closed.
  void unload_if_idle(double now_seconds, double idle_seconds);

  enum class Outcome { merged, duplicate, closed };
  // duplicate: the film has some of its indices. closed: the job has ended. Errors: layout or scale differ;
  // of chains a record that does not follow its chain's present one by one segment. Film, accumulators and
  // records change together or not at all, also if memory runs out (std::bad_alloc). `records`: of a delta of
  // segments one for each index, in order. `border`: the newest that the caller knows. Deltas from it on are
  // ahead: summed apart, and in no snapshot, account, decision or checkpoint until the border moves on.
  Result<Outcome> merge(const film::Delta& delta, std::vector<chains::ChainRecord> records = {},
                        const PrefixBorder& border = {});
  // Sets a border of a newer version. Merges the sums ahead of the old border if the ends differ. If memory
  // runs out nothing changes: std::bad_alloc.
  void move_border(const PrefixBorder& border);
  // Merges what is ahead, if memory allows (see above), or drops it.
  void release_ahead();
  void discard_ahead();
  void close();  // no more merges: what is there is final, but for release_ahead()
  void reopen();
  // The job begins anew: what is merged goes, and its checkpoints with it. This object takes nothing more.
  // Waits for a reader or writer of checkpoints.
  Result<void> discard() CANDELA_REQUIRES(opening_mutex_);
  bool discarded() const;

  // A copy of what is merged now, or of the layers its image is made of (a fraction of the memory where there
  // are more), with the counts of the chains at the same moment, in their order. The film is null where it is
  // not loaded.
  enum class Part { all, image };
  struct Snapshot {
    std::shared_ptr<const film::MergedFilm> film;
    std::vector<chains::ChainCounts> counts;
    std::uint64_t chain_segments = 0;  // by the records
    // The sums of an accumulator that is kept for each half, at the same moment. Null: nothing is merged.
    std::vector<std::array<std::shared_ptr<const film::MergedAccumulator>, 2>> accumulators = {};  // as specs
    std::shared_ptr<const std::string> history = {};  // remember_history()
    stats::MovementSums movement = {};                // of the film
  };
  Snapshot snapshot(Part part = Part::all);
  // Buffers that copies of films reuse one after another. Fresh memory costs a page fault for every 4 KiB, as
  // much time as the copy itself.
  struct Room {
    std::optional<film::MergedFilm> film;
    std::string bytes;
  };
  // Returns snapshot(Part::image), with its film in `room`. `room` must outlive the snapshot unchanged.
  Snapshot snapshot_in(Room& room);
  // Merged indices, and the counts that came with them; empty if the film is not loaded.
  struct Account {
    std::array<film::IndexSet, 2> merged;
    film::SampleCounts sample_counts;
  };
  Account account() const;
  // Indices that it holds: merged ones, and those that are ahead.
  std::array<film::IndexSet, 2> holds() const;
  std::vector<chains::ChainCounts> chain_counts() const;  // empty where it is not loaded
  // Figures of the chains, or of mutations within iterations; nothing if the job has neither.
  std::optional<chains::Summary> chain_summary(const chains::BootstrapSums& bootstrap) const;
  std::size_t largest_record_bytes() const;
  // Every chain has had a segment, and all sums of the image are zero.
  bool all_black() const;

  // The sums of an accumulator: of a half, or of an epoch (`part`). Zeros where nothing is merged; null where
  // the film is not loaded or the job has no such accumulator. They never change.
  std::shared_ptr<const film::MergedAccumulator> accumulator(std::string_view name, std::uint64_t part) const;
  // Remembers a state in the next checkpoint. No effect unless it is of the first epoch without one.
  void remember(const DecidedState& state);
  std::vector<DecidedState> states() const;
  // The history of the error goes into the next checkpoint that something else makes due.
  void remember_history(std::string bytes);

  const film::Layout& layout() const { return layout_; }
  const std::optional<EpochPlan>& epoch_plan() const { return epoch_plan_; }
  // Nothing: the film is not loaded, the job has no epochs, or the epoch to be folded is not whole.
  std::optional<NextDecision> next_decision() const;
  // Takes what was decided: the state, the carry after it, and no sums of the folded epoch from now on, all
  // at once. False, and nothing changes: the film is not at this decision any more. Errors (failed): the film
  // has another state of this epoch, from a checkpoint of the form before carries.
  Result<bool> fold(MadeDecision made);
  // The decisions that are made here, their last state and the carry after it.
  struct Latest {
    std::uint64_t decisions = 0;
    std::shared_ptr<const std::string> state;
    std::shared_ptr<const Carry> carry;
    std::uint64_t statistics_bytes = 0;  // in memory: the carry and all accumulators
  };
  Latest latest() const;
  std::uint64_t decisions() const;
  // Bytes of the accumulators in the deltas that were merged into this object, as they came.
  void received_statistics(std::uint64_t bytes) { received_statistics_bytes_ += bytes; }
  std::uint64_t received_statistics_bytes() const { return received_statistics_bytes_; }
  // The bytes of a state that is not folded; null where they are not kept.
  std::shared_ptr<const std::string> state_bytes(std::uint64_t epoch) const;

  // The records that the segments of a unit start from, those of first segments empty. Never waits for a
  // merge: the scheduler asks while it decides.
  struct Starts {
    enum class State : std::uint8_t {
      whole,
      unread,  // the film is not loaded
      lost,    // the film lacks a segment before, or the unit is none of this film
      merged,  // the film has a segment of the unit
    };
    State state = State::lost;
    ChainRecords records;  // if whole: one for each index, in order
  };
  Starts starts_of(const Unit& unit) const;

  struct Checkpoint {
    std::uint64_t generation = 0;
    std::uint64_t iterations = 0;
  };
  // Writes what is merged now as the next generation. On an error, a lack of memory among them (resource),
  // the one before stays. Merges wait for the encoding only where memory does not suffice for a copy.
  Result<Checkpoint> checkpoint(Room& room);
  Result<Checkpoint> checkpoint() {
    Room room;
    return checkpoint(room);
  }
  bool dirty() const;  // something is merged that is not on disk
  std::uint64_t generation() const;

  void touch(double now_seconds);  // somebody uses it

 private:
  struct Found {
    std::uint64_t generation;
    std::filesystem::path path;
  };
  std::vector<Found> generations() const;  // newest first
  // A checkpoint of this film. Fails (input) on damage, (resource) where the place keeps it from being read.
  Result<ParsedCheckpoint> read(const Found& found) const;
  // Renames it; returns the text that tells of it.
  static std::string set_aside(const Found& found, const Error& error);
  Result<Loading> load() CANDELA_REQUIRES(file_mutex_);
  Result<Verified> verify() CANDELA_REQUIRES(file_mutex_);
  // Content of a checkpoint.
  struct Saved {
    bool loaded = false;
    std::uint64_t generation = 0;  // before it
    std::uint64_t iterations = 0, states = 0, decisions = 0;
  };
  Saved present() const CANDELA_REQUIRES(mutex_);
  Result<void> encode_copy(Room& room, Saved& saved) const;
  Result<void> encode_in_place(Room& room, Saved& saved) const;
  ChainRecords fresh_records() const;
  Result<void> add_sums(const film::Delta& delta, film::MergedFilm& film, stats::MovementSums& movement,
                        Accumulators& accumulators) CANDELA_REQUIRES(mutex_);
  film::MergedAccumulator& editable(Accumulators& accumulators, const AccumulatorKey& key)
      CANDELA_REQUIRES(mutex_);
  // The chain's newest record, also one that is ahead. Precondition: mutex_ or records_mutex_ is held.
  const std::shared_ptr<const chains::ChainRecord>& newest_record(std::uint64_t chain) const
      CANDELA_UNANALYZED;
  const ChainRecords& records() const CANDELA_REQUIRES(mutex_) CANDELA_UNANALYZED { return records_; }
  void merge_ahead() CANDELA_REQUIRES(mutex_);
  void drop_ahead() CANDELA_REQUIRES(mutex_);
  void set_border(const PrefixBorder& border) CANDELA_REQUIRES(mutex_);
  // Adds counts and accumulators to a snapshot. Precondition: the film is loaded.
  void add_all_but_film(Snapshot& snapshot) const CANDELA_REQUIRES(mutex_);
  std::uint32_t image_layers() const { return chains_ > 0 ? chains::kImageLayers : 1; }
  bool saved() const CANDELA_REQUIRES(mutex_);  // nothing has changed since the last checkpoint

  const std::filesystem::path folder_;
  const film::Layout layout_;
  const int scale_log2_;
  const FileWriter writer_;
  const std::uint32_t chains_;
  const std::vector<film::AccumulatorSpec> specs_;
  const std::optional<EpochPlan> epoch_plan_;
  const std::optional<Epochs> epochs_;  // of epoch_plan_
  const double movement_alpha_;

  std::atomic<std::uint64_t> received_statistics_bytes_{0};
  Mutex opening_mutex_;  // taken before all others
  Mutex file_mutex_;     // one reader or writer of checkpoints at a time; taken before mutex_
  mutable Mutex mutex_;
  std::unique_ptr<film::MergedFilm> film_ CANDELA_GUARDED_BY(mutex_);
  // Taken after mutex_, and held for copying pointers only. `records_` changes under both locks, so either of
  // them is enough to read it.
  mutable Mutex records_mutex_;
  ChainRecords records_ CANDELA_GUARDED_BY(records_mutex_);  // by chain
  Accumulators accumulators_ CANDELA_GUARDED_BY(mutex_);
  Decisions decisions_ CANDELA_GUARDED_BY(mutex_);
  std::shared_ptr<const std::string> history_ CANDELA_GUARDED_BY(mutex_);
  stats::MovementSums movement_ CANDELA_GUARDED_BY(mutex_);  // of film_
  PrefixBorder border_ CANDELA_GUARDED_BY(mutex_);
  // The sums beyond the border.
  struct Ahead {
    std::unique_ptr<film::MergedFilm> film;  // null: nothing is there
    stats::MovementSums movement;
    Accumulators accumulators;
    std::map<std::uint64_t, std::shared_ptr<const chains::ChainRecord>> records;  // guarded as records_
  };
  Ahead ahead_ CANDELA_GUARDED_BY(mutex_);
  bool closed_ CANDELA_GUARDED_BY(mutex_) = false, discarded_ CANDELA_GUARDED_BY(mutex_) = false;
  std::uint64_t generation_ CANDELA_GUARDED_BY(mutex_) = 0;  // newest on disk
  std::uint64_t saved_iterations_ CANDELA_GUARDED_BY(mutex_) = 0;
  std::uint64_t saved_states_ CANDELA_GUARDED_BY(mutex_) = 0, saved_decisions_ CANDELA_GUARDED_BY(mutex_) = 0;
  double last_use_ CANDELA_GUARDED_BY(mutex_) = 0;
};

}  // namespace candela::master
