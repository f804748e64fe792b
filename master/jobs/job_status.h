// Status of jobs and workers, as clients and the page are told. The services turn it into messages
// (master/api/messages.h).
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "master/scheduler/scheduler.h"

namespace candela::master {

// Status of a job of epochs: the newest state that is decided, and the statistics behind the decisions.
struct EpochStatus {
  std::uint64_t epoch = 0;                            // of the newest decided state
  std::uint64_t first_iteration = 0, iterations = 0;  // of this epoch
  std::vector<std::pair<std::string, double>>
      figures;                         // of the state, in the rule's order; then of the job's merges
  std::uint64_t statistics_bytes = 0;  // in memory; 0 if the film is not in memory
  std::uint64_t received_bytes = 0;    // of statistics alone, in deltas merged since the film was read
};

struct JobStatus {
  JobRow row;
  std::string message;             // why it failed, or what is worth knowing now
  std::uint64_t units_leased = 0;  // of a job that has not ended
  FailureCounts failures{};
  std::optional<Waiting> waiting;    // nothing: no unit waits
  std::uint64_t bootstrap_done = 0;  // samples, of a job of chains
  std::uint64_t lost = 0;            // sequence indices that the job had and that no checkpoint has any more
  double samples_per_second = 0;     // over the last seconds
  double eta_seconds = 0;            // NaN: unknown
  std::uint64_t worker_memory_bytes =
      0;                              // of the largest worker process that has units of the job; 0: unknown
  std::optional<EpochStatus> epochs;  // of Farm::full_status() alone
  std::string short_id;
  std::size_t workers = 0;  // that have units of it

  std::uint64_t iterations() const { return row.iterations_of(row.iterations); }
  std::uint64_t checkpoint_iterations() const { return row.iterations_of(row.checkpoint_iterations); }
  // Layers of the film beside the image; for chains without the one that is part of the image.
  std::vector<std::string> layers() const;
  // Samples, by film::RejectCause.
  std::array<std::uint64_t, film::kRejectCauses> rejected() const;
  // For a job of chains. b is NaN before the bootstrap is complete.
  chains::Normalisation normalisation() const;
};

// A job or a group as people call it.
struct JobName {
  std::string id, short_id, name, submitter;
  JobState state = JobState::queued;
  std::int64_t submitted_unix_ms = 0;
  bool group = false;
};

// Status of a group (candela.v1.GroupStatus).
struct GroupStatus {
  JobName name;
  std::string message;
  std::int32_t priority = 0;
  double share = 1;
  std::uint32_t frames = 0, frames_submitted = 0;
  std::map<JobState, std::uint32_t> states;
  std::int32_t first_frame = 0, last_frame = 0;
  double fraction_done = 0, worker_seconds = 0;
  double eta_seconds = 0;  // NaN: unknown
  std::size_t workers = 0;
  std::int64_t finished_unix_ms = 0;
  std::set<std::string> depends;
};

struct WorkerStatus {
  WorkerRow row;
  std::string state;    // as candela.v1.WorkerStatus has it
  std::string message;  // its latest failure since its last merged unit, why it was set aside or is stuck
  FailureCounts failures{};
  std::uint64_t resident_bytes = 0;  // memory of its process as it last told; 0: unknown
  std::set<std::string> jobs;        // ids of jobs of its leases
  std::vector<JobName> work;         // these jobs
};

// Precondition of these: the lock of `scheduler` is held.
JobStatus status_of(const Scheduler& scheduler, const Job& job, Now t);
WorkerStatus status_of(const Scheduler& scheduler, const WorkerState& worker, Now t);
JobName name_of(const Scheduler& scheduler, const Job& job);
// Precondition: there is such a group.
JobName name_of_group(const Scheduler& scheduler, const std::string& group_id);
GroupStatus status_of_group(const Scheduler& scheduler, const std::string& group_id, Now t);
std::string message_of(const Scheduler& scheduler, const WorkerState& worker, Now t);  // of its status

}  // namespace candela::master
