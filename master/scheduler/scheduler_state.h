// State of leases, units, jobs and workers in the scheduler. Its source files change it, under one lock.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "common/base/work_monitor.h"
#include "common/film/index_set.h"
#include "common/stages/memory_need.h"
#include "common/stages/prefixes.h"
#include "master/scheduler/audit.h"
#include "master/scheduler/failure.h"
#include "master/scheduler/index_sets.h"
#include "master/scheduler/unit_source.h"
#include "master/store/records.h"

namespace candela::master {

struct Now {
  double seconds = 0;        // steady clock
  std::int64_t unix_ms = 0;  // for people
};

// A running mean in which the newest measurement weighs this much.
inline constexpr double kEwma = 0.3;
inline void blend(double& average, double value) {
  average = average > 0 ? average + kEwma * (value - average) : value;
}

struct Lease {
  LeaseRow row;
  double granted = 0, expires = 0;
  double due_seconds = 0;  // expected from grant to delivery, other leases of the worker included
  bool listed = false;     // some heartbeat named it
  bool cut = false;        // its worker is asked to end it after the iteration under way
  // As the worker's heartbeats tell; no phase: they do not.
  std::optional<WorkPhase> phase;
  std::uint64_t steps = 0;
  double stepped = 0;  // when the steps last grew
};

// Report of a heartbeat about one unit.
struct UnitReport {
  UnitReport(std::uint64_t of_token, std::optional<WorkPhase> in_phase = {}, std::uint64_t so_many_steps = 0)
      : token(of_token), phase(in_phase), steps(so_many_steps) {}
  std::uint64_t token;
  std::optional<WorkPhase> phase;  // none: the worker does not tell
  std::uint64_t steps;
};

// The failures of a unit that is not done. Its row counts the failures of cause worker over restarts.
struct UnitTrouble {
  std::array<std::uint32_t, kFailureCauses> failures{};
  std::uint32_t lost = 0;                          // leases, with workers that fell silent
  double retry_at = 0;                             // earliest retry of the unit
  std::map<std::string, std::uint32_t> by_worker;  // worker id: failures of cause scene and worker
  std::set<std::string> witnesses;                 // distinct workers behind those of cause worker
  std::set<std::string> refused_by;                // distinct workers that named the scene
  FailureCause cause = FailureCause::worker;       // of the latest failure, as are the texts
  std::string worker_name, text;
  std::string refusal;  // what the latest of `refused_by` said
};

struct UnitState {
  UnitRow row;
  std::vector<std::uint64_t> leases;
  std::optional<UnitTrouble> trouble;
  std::optional<Audit> audit;  // others render it, too. Of a recheck the unit is merged, and no row is of it
  bool speculated = false;
  bool waits(double seconds) const { return trouble && trouble->retry_at > seconds; }
};

// Failures of a worker with a job since its last delivery for the job.
struct Standing {
  std::uint32_t failures = 0;  // in a row
  double retry_at = 0;         // earliest retry of the job on this worker
};

// Progress of a job at some time.
struct Progress {
  double seconds = 0;
  std::uint64_t samples = 0, indices = 0;
};

// The jobs of one group. They are served as one: frame after frame, with one share of the farm's time.
struct GroupState {
  std::set<std::string> jobs;                                                 // ids
  double virtual_time = 0;                                                    // as Job's
  std::int64_t submitted_unix_ms = std::numeric_limits<std::int64_t>::max();  // of the first
};

struct Job {
  JobRow row;
  // Its stop rule holds: no leases, no merges. It is done once the final checkpoint is on disk.
  bool finishing = false;
  std::string note;  // what is worth knowing now, e.g. that checkpoints fail
  std::array<film::IndexSet, 2> merged;
  std::map<std::uint64_t, UnitState> units;  // not merged
  std::set<std::uint64_t> maybe_open;        // has each unit without a lease; pick() drops others
  // Its time is up, and it goes on until it has these indices, or until then by the steady clock.
  std::optional<HalfSets> level;
  double level_until = 0;
  double virtual_time = 0;      // worker seconds / share, for fairness; see served()
  GroupState* group = nullptr;  // of a frame
  double thread_seconds = 0;    // EWMA of seconds times threads per iteration
  std::map<std::string, double> worker_seconds_per_iteration;  // EWMA
  double overhead_seconds = 0;                                 // EWMA per delta
  double merge_seconds = 0;                                    // of that, in which no other is merged
  double last_tick = 0;                                        // up to when elapsed_seconds counts
  std::uint64_t leases = 0;                                    // of its units
  std::uint64_t under_way = 0;  // workers whose oldest lease is one of these: they compute it
  double unleased_since = 0;    // of a job without leases
  double last_saved = 0;
  // For a job that ends by its error: the prefix that is to be looked at next, in rounds of a half
  // (prefixes.h); 0: none. The version changes whenever that may.
  std::uint64_t prefix = 0, prefix_version = 0;
  std::uint64_t units_ahead = 0;  // merged beyond it
  std::deque<Progress> recent;

  std::unique_ptr<UnitSource> source;  // of the present stage

  // For a job of chains.
  std::vector<std::uint64_t> starts;  // of each chain: a bootstrap sample
  std::size_t record_bytes = 0;       // of the largest chain record seen
  std::uint64_t reported_stay = 0;    // the longest stay of a chain that an event has reported

  // Decided states of epochs 0, 1, ... of a job of epochs. Their bytes are there.
  std::vector<StateRow> states;
  std::vector<std::string> known_states;  // SHA-256 of every state that was ever decided

  FailureCounts failures{};                   // since the master started
  std::map<std::string, Standing> standings;  // by worker id; only those that failed
  std::set<std::string> refused_by;           // distinct workers that named the scene since the last delivery
  bool told_waiting = false;                  // an event has, since the last delivery
  // Distinct workers that made no step in a phase, and how often, since they last brought something.
  std::map<WorkPhase, std::map<std::string, std::uint32_t>> stuck;
  std::map<std::string, std::string> lacks;  // SHA-256 of a blob that the master has lost: what to say of it

  MemoryNeed need;             // of the master's memory; meaningful after the pilot
  bool admitted = false;       // that memory is the job's until it ends
  double retry_memory_at = 0;  // it is not admitted before: the system had less than was counted on
  std::string memory_wait;     // what it waits for; empty: nothing

  // --- audits ---
  std::set<std::uint64_t> held;   // units that somebody has rendered, and that wait for another's answer
  std::uint64_t rechecks = 0;     // units that are merged, or the pilot
  bool doubts_due = false;        // what workers that are distrusted now have merged is to be looked for,
  std::uint64_t doubts = 0;       // so often already
  std::uint64_t first_token = 0;  // leases before it are of a film that is gone
  // It must not end.
  bool doubtful() const { return doubts_due || rechecks > 0 || !row.audit.anew.empty(); }

  bool planned() const { return row.named_state || row.chains; }  // the pilot is done
  // Its film may be in memory.
  bool has_memory() const { return admitted || !planned() || finishing; }
  bool open_for_leases() const {
    return !finishing && (row.state == JobState::queued || row.state == JobState::running) && has_memory() &&
           row.audit.anew.empty() && row.depends.empty();
  }
  // The virtual time that counts: for a frame the group's.
  double& served() { return group != nullptr ? group->virtual_time : virtual_time; }
  double served() const { return group != nullptr ? group->virtual_time : virtual_time; }
  // The indices that it asks for, where they are not all below target().
  const HalfSets* asked() const;
  // One past the last index of a half that it asks for; no limit: the largest there may be. Of a job of
  // chains an iteration of the stop rule is a round: a segment of each chain.
  std::uint64_t target(std::uint32_t half) const;
  // The same without exact indices, and while it does not end level.
  std::uint64_t limit(std::uint32_t half) const;
  // Indices below target() that it does not ask for.
  HalfSets unwanted() const;
  PrefixBorder border() const;
  // True if the stop rule's number of iterations may end the job: all prefixes up to there are decided.
  bool prefixes_done() const;
  // Nothing of what it has lost lies beyond the prefix.
  bool prefix_has_promised() const;
  JobView view(std::uint64_t active_workers = 1) const;
  bool in_bootstrap() const { return source->table() != nullptr; }
  // Indices that the job has had and whose checkpoints are lost.
  HalfSets lost() const { return without(row.promised, merged); }
};

// The memory that a job needs once its pilot is done.
MemoryNeed need_of(const JobRow& row, std::size_t record_bytes = 0);
// The same of a job that has this plan.
MemoryNeed need_of(const JobRow& row, const WorkPlan& work, std::size_t record_bytes = 0);

// A unit that a worker does not own any more, and may compute all the same.
struct Leftover {
  std::string job_id;
  double since = 0;
  bool named = false;  // by a heartbeat
  std::optional<WorkPhase> phase;
};

struct WorkerState {
  WorkerRow row;
  double last_seen = 0;
  double last_asked = 0;        // for a unit
  bool called = false;          // after it registered
  bool awaited = false;         // since a restart of the master it has not called
  bool told_of_loss = false;    // an event has
  bool distrusted = false;      // its identity is
  std::uint32_t borne_out = 0;  // of its first units, by other workers
  std::set<std::uint64_t> leases;
  std::map<std::uint64_t, Leftover> leftovers;  // by token
  std::uint32_t consecutive_failures = 0;       // of causes of its own
  std::set<std::string> failed_jobs;            // since its last merged unit
  std::uint32_t times_set_aside = 0;            // since its last merged unit
  double set_aside_until = 0;
  double silence_told = -1;  // the `last_seen` of a silence for which a unit has been counted as lost
  FailureCounts failures{};  // since the master started
  std::string message;
  std::uint64_t resident_bytes = 0;  // of its process, as it last told; 0: unknown
};

// The state of a job that waits after failures.
struct Waiting {
  FailureCause cause = FailureCause::worker;
  std::uint64_t units = 0;
  std::int64_t retry_unix_ms = 0;  // in whole seconds, rounded up; 0: as soon as a worker can
  std::string text;
};

}  // namespace candela::master
