// A stage of a job's work as the scheduler sees it: which units there are, which of them can be rendered now,
// and what each starts from. Pilot, bootstrap, iterations and segments are stages; iterations and segments
// may come in epochs (open_epochs.h). make_source() is the one place that tells stages apart.
//
// Pure logic without a clock. A source remembers which indices it has cut into units; what is merged is told
// by the caller, who keeps one set for the job.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/chains/chains.h"
#include "common/job/job.h"
#include "master/scheduler/index_sets.h"
#include "master/store/records.h"

namespace candela::master {

// The job of a source at one moment.
struct JobView {
  const HalfSets& merged;
  std::array<std::uint64_t, 2> target;   // one past the last index of each half that the job asks for
  std::array<std::uint64_t, 2> open_to;  // and of those that may be cut now
  bool bounded = false;                  // it asks for a number of iterations
  std::uint64_t active_workers = 1;      // that can take units of the job
  std::size_t record_bytes = 0;          // of the largest chain record seen
  std::span<const std::uint64_t> chain_starts;
  std::span<const StateRow> states;            // of epochs 0, 1, ...
  std::array<std::uint64_t, 2> unwanted = {};  // number of indices below `target` that it does not ask for
};

// Indices of a stage.
struct Extent {
  std::uint64_t remaining = 0;  // not cut into units yet
  std::uint64_t cut = 0;
  bool bounded = false;  // the stage ends when `remaining` are cut
};

// The cost of a stage's units, beside the measured seconds of an iteration.
struct StageCost {
  double indices_per_iteration = 1;  // that take as long as one iteration
  double min_charged_seconds = 0;    // of worker time, when a unit is leased
  double min_straggler_seconds = 1;  // before a leased unit counts as a straggler
  bool serial = false;               // one thread renders an index
};

enum class Claim : std::uint8_t {
  open,     // a unit of this stage that is not merged
  merged,   // some of it is, or its whole stage is over
  foreign,  // the job has no such unit
};

// The start of one chain of a unit: a record, or the bootstrap sample of a chain without segments.
struct UnitStart {
  std::uint64_t bootstrap_sample = 0;
  std::shared_ptr<const chains::ChainRecord> record;
};

// A unit's own inputs, beside those of the whole job.
struct UnitInput {
  std::vector<UnitStart> chain_starts;  // of a unit of segments: one for each index, in order
  std::vector<StateRow> states;         // that were decided for the unit
};

// The films' side of a unit's inputs. The scheduler asks it while it decides, so it answers from memory.
class FilmInputs {
 public:
  using Records = std::vector<std::shared_ptr<const chains::ChainRecord>>;
  enum class State : std::uint8_t {
    whole,
    unread,  // the film is not in memory
    lost,    // the film does not hold the segments before
    merged,  // the film has the unit already, and its verdict is on its way
  };
  struct Answer {
    State state = State::whole;
    Records records;
  };
  virtual ~FilmInputs() = default;
  virtual Answer chain_records(const std::string& job_id, const Unit& unit) const = 0;
};

class UnitSource {
 public:
  virtual ~UnitSource() = default;
  virtual Unit::Kind kind() const = 0;
  virtual StageCost cost() const { return {}; }
  // True if its units are summed in the job's film, so that the stop rule ends it.
  virtual bool makes_film() const { return true; }
  // Plural noun of its indices, for people.
  virtual std::string_view noun() const { return "iterations"; }

  // The next unit of at most `want` indices. Empty: none can be cut now.
  virtual std::optional<Unit> cut(const JobView& job, std::uint64_t want) = 0;
  virtual bool has_unit(const JobView& job) const = 0;
  virtual Extent extent(const JobView& job) const = 0;
  // Indices that can be rendered at the same time now, by any number of workers: those in units, and those
  // that could be cut.
  virtual std::uint64_t open_indices(const JobView& job) const = 0;
  // No unit that is cut now has more indices.
  virtual std::uint64_t max_unit(const JobView& job) const;

  // Takes a unit that was cut before a restart. False: it is foreign, merged, reserved, or cannot be rendered
  // now.
  virtual bool take(const JobView& job, const Unit& unit);
  // The scheduler keeps the unit no longer: its indices can be cut again.
  virtual void put_back(const Unit& unit);
  // No units are left: what is not in `closed` can be cut again.
  virtual void restart(const HalfSets& closed) { reserved_ = closed; }
  const HalfSets& reserved() const { return reserved_; }

  virtual Claim claim(const HalfSets& merged, const Unit& unit) const;
  virtual bool needs_film() const { return false; }  // to give the inputs of a unit
  // `records`: of the film, where the source needs it.
  virtual UnitInput input(const JobView& job, const Unit& unit, FilmInputs::Records records) const;

  // The epoch whose state can and must be decided next.
  virtual std::optional<std::uint64_t> due_decision(const JobView&) const { return std::nullopt; }

  // True if these indices can be rendered without any others; `why` says what they lack.
  virtual bool complete(const HalfSets&, std::string& /*why*/) const { return true; }

  // A stage whose units bring parts of one table. Null for others.
  virtual const chains::BootstrapTable* table() const { return nullptr; }
  // Errors (input): the values are not those of the unit's indices, or the stage has no table.
  virtual Result<void> add(const Unit& unit, std::span<const float> values);

 protected:
  // True if a unit of indices that nobody has could be rendered now.
  virtual bool ready(const JobView&, const Unit&) const { return true; }
  // The half to cut from first: halves advance together, so that an error estimate is there early.
  std::uint32_t half_behind() const { return reserved_[0].count() <= reserved_[1].count() ? 0 : 1; }

  HalfSets reserved_;  // merged, or in units, or not wanted
};

// The extent of a stage whose indices the target bounds.
Extent film_extent(const JobView& job, const HalfSets& reserved);

// The source of the stage that a job with this row is in.
std::unique_ptr<UnitSource> make_source(const JobRow& row);
// The source of the stage that makes the job's film. Precondition: the job's pilot is done.
std::unique_ptr<UnitSource> make_film_source(const JobRow& row);

// The makers of the single stages.
std::unique_ptr<UnitSource> make_pilot_source();
std::unique_ptr<UnitSource> make_bootstrap_source(const ChainPlan& plan);
// `in_groups`: no unit crosses the border of a group of the movement's sums (stats::end_of_group).
std::unique_ptr<UnitSource> make_iteration_source(const std::optional<EpochPlan>& epochs, bool in_groups);
std::unique_ptr<UnitSource> make_segment_source(const ChainPlan& plan,
                                                const std::optional<EpochPlan>& epochs);

}  // namespace candela::master
