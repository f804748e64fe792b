#include "master/jobs/job_status.h"

#include <array>
#include <limits>
#include <string>

#include "common/wire/wire.h"

namespace candela::master {
namespace {

void set_failures(const FailureCounts& counts, google::protobuf::RepeatedPtrField<v1::FailureCount>& out) {
  for (const FailureCause cause : kAllFailureCauses) {
    if (counts[index_of(cause)] == 0) continue;
    v1::FailureCount& failure = *out.Add();
    failure.set_cause(wire::to_proto(cause));
    failure.set_count(counts[index_of(cause)]);
  }
}

}  // namespace

v1::JobStatus status_of(const Scheduler& scheduler, const Job& job, Now t) {
  const JobRow& r = job.row;
  v1::JobStatus out;
  out.set_id(r.id);
  out.set_name(r.name);
  static constexpr std::array<v1::JobState, 6> kStates = {v1::JOB_STATE_QUEUED, v1::JOB_STATE_RUNNING,
                                                          v1::JOB_STATE_PAUSED, v1::JOB_STATE_DONE,
                                                          v1::JOB_STATE_FAILED, v1::JOB_STATE_CANCELLED};
  out.set_state(kStates[static_cast<std::size_t>(r.state)]);
  out.set_message(scheduler.message_of(job, t));
  out.set_priority(r.priority);
  out.set_share(r.share);
  wire::to_proto(r.settings, *out.mutable_settings());
  wire::to_proto(r.stop, *out.mutable_stop());
  out.set_bundle_sha256(r.bundle_sha256);
  if (r.named_state) wire::to_proto(*r.named_state, *out.mutable_named_state());
  out.set_units_merged(r.units_merged);
  out.set_iterations(r.iterations_of(r.iterations));
  out.set_samples(r.tallies.eye_samples);
  out.set_light_paths(r.tallies.light_paths);
  out.set_rays(r.tallies.rays);
  out.set_bounded_walks(r.tallies.bounded_walks);
  out.set_relmse_estimate(r.relmse);
  const bool open = !has_ended(r.state);  // thousands of others have no leases to be looked for
  if (open) out.set_units_leased(scheduler.leases_of(r.id));
  out.set_elapsed_seconds(r.elapsed_seconds);
  out.set_worker_seconds(r.worker_seconds);
  for (int i = 0; i < film::kRejectCauses; ++i) {
    const auto cause = static_cast<std::size_t>(i);
    const std::uint64_t n = r.tallies.rejected[cause] + r.bootstrap_rejected[cause];
    if (n == 0) continue;
    v1::RejectedSamples& rejected = *out.add_rejected();
    rejected.set_cause(std::string(film::name(static_cast<film::RejectCause>(i))));
    rejected.set_count(n);
  }
  set_failures(job.failures, *out.mutable_failures());
  if (const auto waiting = scheduler.waiting_of(job, t)) {
    out.mutable_waiting()->set_cause(wire::to_proto(waiting->cause));
    out.mutable_waiting()->set_units(waiting->units);
    out.mutable_waiting()->set_retry_unix_ms(waiting->retry_unix_ms);
  }
  out.set_submitted_unix_ms(r.submitted_unix_ms);
  out.set_finished_unix_ms(r.finished_unix_ms);
  out.set_plan(r.plan);
  for (std::size_t i = r.chains ? chains::kImageLayers - 1 : 0; i < r.layers.size(); ++i)
    out.add_layers(r.layers[i]);
  if (r.chains) {
    v1::ChainStatus& status = *out.mutable_chains();
    wire::to_proto(r.chain_summary, status);
    wire::to_proto(*r.chains, *status.mutable_plan());
    const chains::BootstrapTable* table = job.source->table();
    status.set_bootstrap_done(table != nullptr ? table->known().count() : r.chains->bootstrap_samples);
    if (!r.named_state) {
      status.set_b(std::numeric_limits<double>::quiet_NaN());
      status.set_b_standard_error(std::numeric_limits<double>::quiet_NaN());
    }
  }
  out.set_checkpoint_generation(r.checkpoint_generation);
  out.set_checkpoint_iterations(r.iterations_of(r.checkpoint_iterations));
  out.set_lost(count(job.lost()));
  out.set_repairing(r.repairs_to.has_value());
  out.set_samples_per_second(scheduler.samples_per_second(job, t));
  out.set_eta_seconds(scheduler.eta_seconds(job, t));
  if (open) out.set_worker_memory_bytes(scheduler.worker_memory_of(r.id));
  return out;
}

v1::WorkerStatus status_of(const Scheduler& scheduler, const WorkerState& w, Now t) {
  v1::WorkerStatus out;
  out.set_id(w.row.id);
  out.set_name(w.row.name);
  out.set_state(scheduler.worker_state_name(w, t));
  out.set_threads(w.row.threads);
  out.set_build_id(w.row.build_id);
  out.set_host(w.row.host);
  out.set_units_merged(w.row.units_merged);
  out.set_units_failed(w.row.units_failed);
  out.set_last_seen_unix_ms(w.row.last_seen_unix_ms);
  out.set_message(w.message);
  out.set_resident_bytes(w.resident_bytes);
  set_failures(w.failures, *out.mutable_failures());
  for (const std::string& job : scheduler.jobs_of(w)) out.add_jobs(job);
  return out;
}

}  // namespace candela::master
