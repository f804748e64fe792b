// Records of the master: jobs, units, leases, workers, events. Plain rows, shared by the scheduler (which
// decides) and the store (which keeps); neither knows the other.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "common/chains/chains.h"
#include "common/film/counts.h"
#include "common/film/index_text.h"
#include "common/job/job.h"
#include "common/stages/work_plan.h"

namespace candela::master {

enum class JobState : std::uint8_t { queued, running, paused, done, failed, cancelled };
inline bool has_ended(JobState s) {
  return s == JobState::done || s == JobState::failed || s == JobState::cancelled;
}

// Units of an ended job that a worker delivered which is distrusted now.
struct Taint {
  std::string worker;  // identity (audit.h)
  std::int64_t since_unix_ms = 0;
  std::uint64_t units = 0;  // 0: it made the pilot or a part of the bootstrap alone
  bool operator==(const Taint&) const = default;
};

// Facts about the workers that made a job, beside its merged units. Workers by identity (audit.h).
struct JobAudit {
  std::string pilot_sha256;           // of what is pure in the pilot's result; empty: not known
  std::vector<std::string> pilot_by;  // who brought this result
  bool pilot_due = false;             // another worker is to make the pilot, too
  std::vector<std::string> bootstrap_by;
  std::string anew;  // why the job is to begin anew; empty: it is not
  std::vector<Taint> taints;
  bool operator==(const JobAudit&) const = default;
};

// A job as one frame of a group: the jobs of one group_id.
struct FrameRow {
  std::string group_id, group_name;
  std::int32_t frame = 0;
  std::uint32_t frames = 0;  // of the group, as its submitter named them
  bool operator==(const FrameRow&) const = default;
};

// In the place of the id of a build that was not kept.
inline constexpr const char* kUnknownBuild = "?";

struct JobRow {
  std::string id, name, bundle_sha256;
  std::string submitter;  // user@host, or the name of a certificate; empty: unknown
  JobSettings settings;
  StopRule stop;
  film::HalfSets stop_indices;       // exactly these end the job, and no limit of `stop`; empty: it has none
  std::string scene_path;            // of the scene file, as the submitter typed it; empty: not known
  std::optional<FrameRow> frame;     // nothing: it is of no group
  std::vector<std::string> depends;  // ids of jobs and groups that it waits for
  std::int32_t priority = 0;
  double share = 1;
  std::string idempotency_token, content_digest;  // digest of the submission, to recognize a repeated one
  JobState state = JobState::queued;
  std::string message;      // why it failed, and the like
  std::string stop_reason;  // "iterations", "time", "relmse", "indices", "black"; empty while it runs
  std::optional<NamedState> named_state;  // without `decided`
  std::string decided;                    // what the pilot decided, of all units' states
  bool pilot_outdated = false;            // the pilot was of a build that kept nothing of what it decided
  std::vector<std::string> builds;        // whose pilot, bootstrap and units it has, in their order
  std::string plan;
  std::vector<film::AccumulatorSpec> accumulators;  // beside the film; valid (film::validate)
  std::optional<EpochPlan> epochs;
  std::optional<DevelopmentPlan> development;
  std::vector<std::string> layers;  // of the film beside the image; valid (film::make_layout)
  std::optional<ChainPlan>
      chains;                // of a job of Markov chains, from the pilot; its state follows the bootstrap
  int pilot_scale_log2 = 0;  // of a job of chains: for want of a better one
  chains::BootstrapSums bootstrap;  // of the whole bootstrap; meaningless before
  std::array<std::uint64_t, film::kRejectCauses> bootstrap_rejected{};
  chains::Summary chain_summary;            // as of the last look at the film's records
  double thread_seconds_per_iteration = 0;  // of one index: seconds times threads; 0: not measured yet
  std::int64_t submitted_unix_ms = 0, finished_unix_ms = 0;
  double elapsed_seconds = 0;  // in which units of it were under way
  double worker_seconds = 0;   // of merged units
  std::uint64_t units_merged = 0;
  film::SampleCounts sample_counts;  // of merged units
  double relmse = std::numeric_limits<double>::quiet_NaN();
  double relmse_upper = std::numeric_limits<double>::quiet_NaN();  // not stored: convergence.txt has it
  std::uint64_t checkpoint_generation = 0, checkpoint_iterations = 0;
  std::uint64_t iterations = 0;  // merged indices of both halves; of chains: segments
  // Indices of each half that the job had when it ended. Set when its checkpoints are found to hold fewer,
  // and cleared when the film has them all again: what the film lacks of them is lost until then.
  std::array<film::IndexSet, 2> promised;
  // The state that a repair leads back to; none while no repair is under way.
  std::optional<JobState> repairs_to;
  JobAudit audit;

  // Iterations as people count them: indices, or for a job of chains rounds, in which every chain has one
  // segment.
  std::uint64_t indices_per_iteration() const { return chains ? chains->chains : 1; }
  std::uint64_t iterations_of(std::uint64_t indices) const { return indices / indices_per_iteration(); }
  // Chains of a half; 1 for other jobs, whose every index is a round of its half.
  std::uint64_t per_round() const { return chains ? chains->chains / 2 : 1; }
  // Iterations that its stop rule names, by number or as exact indices; 0: neither.
  std::uint64_t iterations_asked() const {
    const std::uint64_t exact = stop_indices[0].count() + stop_indices[1].count();
    return exact == 0 ? stop.iterations : (exact - 1) / indices_per_iteration() + 1;
  }
  // Sequence indices of a half in so many iterations.
  std::uint64_t indices_of(std::uint32_t half, std::uint64_t n) const {
    if (chains) return std::min(n * per_round(), Limits::max_iterations);
    return half == 0 ? (n + 1) / 2 : n / 2;
  }
};

// State that a job's units start from, once the pilot is done.
inline NamedState state_of_units(const JobRow& row) {
  NamedState state = row.named_state.value_or(NamedState{row.pilot_scale_log2});
  state.decided = row.decided;
  return state;
}

inline film::Layout layout_of(const JobRow& row) {
  return {row.settings.width, row.settings.height, 1 + static_cast<std::uint32_t>(row.layers.size())};
}

inline WorkPlan work_of(const JobRow& row) {
  return {row.layers, row.accumulators, row.chains, row.epochs, row.development};
}

// Development of the job's film, by the counts of its chains at that moment.
inline film::Development development_of(const JobRow& row, std::span<const chains::ChainCounts> counts) {
  if (!row.chains || !row.named_state) return {};
  return chains::development(row.named_state->bootstrap_b, chains::pool(row.bootstrap, counts));
}

struct UnitRow {
  enum class State : std::uint8_t { open, leased, merged };
  std::uint64_t id = 0;
  std::string job_id;
  Unit unit;
  State state = State::open;
  std::uint32_t failures = 0;
  std::string worker_id;    // who delivered it
  std::uint64_t token = 0;  // with which lease
  double seconds = 0;       // render time of the merged delta
  // For a merged unit: who brought this content, by identity (audit.h), the deliverer first; and the SHA-256
  // of the merged delta. Empty: not known.
  std::vector<std::string> by;
  std::string sha256;
};

struct LeaseRow {
  std::uint64_t token = 0, unit_id = 0;
  std::string job_id, worker_id;
  double expected_seconds = 0;
  bool speculative = false;
};

// Result of a unit of bootstrap samples. Kept until the whole bootstrap is there, then its starts are.
struct BootstrapRow {
  std::string job_id;
  std::uint64_t begin = 0;
  std::vector<float> contributions;
  std::array<std::uint64_t, film::kRejectCauses> rejected{};
};

// The state of an epoch, decided from merged sums. Its bytes are a blob.
struct StateRow {
  std::string job_id;
  std::uint64_t epoch = 0;
  std::string name, sha256;
  std::uint64_t size_bytes = 0;
  bool operator==(const StateRow&) const = default;
};

struct WorkerRow {
  std::string id, session, name, host, build_id;
  std::string certificate;  // its name, with TLS; not kept over a restart of the master
  std::uint32_t threads = 1;
  std::vector<std::string> isas;
  bool draining = false, paused = false;
  std::uint64_t units_merged = 0, units_failed = 0;
  std::int64_t last_seen_unix_ms = 0;
};

// A worker whose samples were found false.
// Makers of merged units, by identity (audit.h), the deliverer first, and the id by which it delivered.
struct MakerRow {
  std::string worker_id;
  std::vector<std::string> by;
};

struct DistrustRow {
  std::string worker;  // identity (audit.h)
  std::int64_t since_unix_ms = 0;
  std::string reason;
};

// An ended job that is to be removed, and for how many seconds, by steady clocks, it has been overdue.
struct OverdueRow {
  std::string job_id;
  std::int64_t finished_unix_ms = 0;
  double waited_seconds = 0;
};

struct EventRow {
  std::int64_t unix_ms = 0;
  std::string job_id, worker_id, kind, message;
};

// One change to what is remembered. Changes are applied in order, several in one transaction.
struct PutJob {
  JobRow row;
};
struct PutUnit {
  UnitRow row;
};
struct DropUnit {
  std::uint64_t id;
};
struct DropUnmergedUnits {
  std::string job_id;
};  // and their leases
// Merged units of a job that begin at `begin` of their half or later: they are no part of its image.
struct DropMergedFrom {
  std::string job_id;
  std::array<std::uint64_t, 2> begin;
};
struct PutLease {
  LeaseRow row;
};
struct DropLease {
  std::uint64_t token;
};
struct PutWorker {
  WorkerRow row;
};
struct DropWorker {
  std::string id;
};
struct AddEvent {
  EventRow row;
};
struct PutBundle {
  std::string sha256, bytes;
};
struct PutBootstrap {
  BootstrapRow row;
};
// The bootstrap samples the job's chains start from; the bootstrap's rows go.
struct PutStarts {
  std::string job_id;
  std::vector<std::uint64_t> starts;
};
struct PutState {
  StateRow row;
};
// All jobs that wait for their removal.
struct PutOverdue {
  std::vector<OverdueRow> rows;
};
struct PutDistrust {
  DistrustRow row;
};
struct DropDistrust {
  std::string worker;
};
// A job begins anew: its units, leases, states and bootstrap go.
struct ForgetWork {
  std::string job_id;
};
// A removed job with all its rows, and its bundle if no other job has it. Its events stay.
struct DropJob {
  std::string id;
};
using Change = std::variant<PutJob, PutUnit, DropUnit, DropUnmergedUnits, PutLease, DropLease, PutWorker,
                            DropWorker, AddEvent, PutBundle, PutBootstrap, PutStarts, PutState, PutOverdue,
                            DropJob, PutDistrust, DropDistrust, ForgetWork, DropMergedFrom>;

// "queued", "running", ...
std::string_view name(JobState state);

}  // namespace candela::master
