#include "master/api/messages.h"

#include <string>

#include "common/base/hash.h"
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

void set_chains(const JobStatus& status, v1::ChainStatus& out) {
  const JobRow& r = status.row;
  wire::to_proto(r.chain_summary, out);
  if (!r.chains) return;  // mutations within iterations
  wire::to_proto(*r.chains, *out.mutable_plan());
  out.set_bootstrap_done(status.bootstrap_done);
  const chains::Normalisation b = status.normalisation();
  out.set_b(b.b);
  out.set_b_standard_error(b.standard_error);
}

void set_epochs(const EpochStatus& status, v1::EpochStatus& out) {
  out.set_epoch(status.epoch);
  out.set_first_iteration(status.first_iteration);
  out.set_iterations(status.iterations);
  for (const auto& [name, value] : status.figures) {
    v1::Figure& figure = *out.add_figures();
    figure.set_name(name);
    figure.set_value(value);
  }
  out.set_statistics_bytes(status.statistics_bytes);
  out.set_received_bytes(status.received_bytes);
}

}  // namespace

v1::JobState to_message(JobState state) {
  static_assert(v1::JOB_STATE_QUEUED == static_cast<int>(JobState::queued) + 1 &&
                v1::JOB_STATE_CANCELLED == static_cast<int>(JobState::cancelled) + 1);
  return static_cast<v1::JobState>(static_cast<int>(state) + 1);
}

v1::JobName to_message(const JobName& name) {
  v1::JobName out;
  out.set_id(name.id);
  out.set_short_id(name.short_id);
  out.set_name(name.name);
  out.set_submitter(name.submitter);
  out.set_state(to_message(name.state));
  out.set_submitted_unix_ms(name.submitted_unix_ms);
  out.set_group(name.group);
  return out;
}

v1::GroupStatus to_message(const GroupStatus& status) {
  v1::GroupStatus out;
  out.set_id(status.name.id);
  out.set_short_id(status.name.short_id);
  out.set_name(status.name.name);
  out.set_submitter(status.name.submitter);
  out.set_state(to_message(status.name.state));
  out.set_message(status.message);
  out.set_priority(status.priority);
  out.set_share(status.share);
  out.set_frames(status.frames);
  out.set_frames_submitted(status.frames_submitted);
  for (const auto& [state, jobs] : status.states) {
    v1::StateCount& count = *out.add_states();
    count.set_state(to_message(state));
    count.set_jobs(jobs);
  }
  out.set_first_frame(status.first_frame);
  out.set_last_frame(status.last_frame);
  out.set_fraction_done(status.fraction_done);
  out.set_worker_seconds(status.worker_seconds);
  out.set_eta_seconds(status.eta_seconds);
  out.set_workers(static_cast<std::uint32_t>(status.workers));
  out.set_submitted_unix_ms(status.name.submitted_unix_ms);
  out.set_finished_unix_ms(status.finished_unix_ms);
  for (const std::string& id : status.depends) out.add_depends(id);
  return out;
}

v1::JobStatus to_message(const JobStatus& status) {
  const JobRow& r = status.row;
  v1::JobStatus out;
  out.set_id(r.id);
  out.set_name(r.name);
  out.set_submitter(r.submitter);
  out.set_scene_path(r.scene_path);
  out.set_state(to_message(r.state));
  out.set_message(status.message);
  out.set_priority(r.priority);
  out.set_share(r.share);
  wire::to_proto(r.settings, *out.mutable_settings());
  wire::to_proto(r.stop, r.stop_indices, *out.mutable_stop());
  out.set_bundle_sha256(r.bundle_sha256);
  if (r.named_state) wire::to_proto(*r.named_state, *out.mutable_named_state());
  out.set_units_merged(r.units_merged);
  out.set_iterations(status.iterations());
  out.set_samples(r.sample_counts.eye_samples);
  out.set_light_paths(r.sample_counts.light_paths);
  out.set_bounded_walks(r.sample_counts.bounded_walks);
  out.set_rays(r.sample_counts.rays);
  out.set_relmse_estimate(r.relmse);
  out.set_relmse_upper(r.relmse_upper);
  out.set_units_leased(status.units_leased);
  out.set_elapsed_seconds(r.elapsed_seconds);
  out.set_worker_seconds(r.worker_seconds);
  const auto counts = status.rejected();
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (counts[i] == 0) continue;
    v1::RejectedSamples& rejected = *out.add_rejected();
    rejected.set_cause(std::string(film::name(static_cast<film::RejectCause>(i))));
    rejected.set_count(counts[i]);
  }
  set_failures(status.failures, *out.mutable_failures());
  if (status.waiting) {
    out.mutable_waiting()->set_cause(wire::to_proto(status.waiting->cause));
    out.mutable_waiting()->set_units(status.waiting->units);
    out.mutable_waiting()->set_retry_unix_ms(status.waiting->retry_unix_ms);
  }
  out.set_submitted_unix_ms(r.submitted_unix_ms);
  out.set_finished_unix_ms(r.finished_unix_ms);
  out.set_plan(r.plan);
  for (const std::string& layer : status.layers()) out.add_layers(layer);
  if (r.chains || !chains::by_mutation(r.chain_summary).empty()) set_chains(status, *out.mutable_chains());
  out.set_checkpoint_generation(r.checkpoint_generation);
  out.set_checkpoint_iterations(status.checkpoint_iterations());
  out.set_lost(status.lost);
  out.set_repairing(r.repairs_to.has_value());
  out.set_samples_per_second(status.samples_per_second);
  out.set_eta_seconds(status.eta_seconds);
  out.set_worker_memory_bytes(status.worker_memory_bytes);
  out.set_short_id(status.short_id);
  if (r.frame) {
    v1::Frame& frame = *out.mutable_frame();
    frame.set_group_id(r.frame->group_id);
    frame.set_group_name(r.frame->group_name);
    frame.set_frame(r.frame->frame);
    frame.set_frames(r.frame->frames);
  }
  for (const std::string& id : r.depends) out.add_depends(id);
  out.set_workers(static_cast<std::uint32_t>(status.workers));
  if (status.epochs) set_epochs(*status.epochs, *out.mutable_epochs());
  for (const Taint& taint : r.audit.taints) {
    v1::Taint& t = *out.add_taints();
    t.set_worker(taint.worker);
    t.set_since_unix_ms(taint.since_unix_ms);
    t.set_units(taint.units);
  }
  return out;
}

v1::DistrustedWorker to_message(const DistrustRow& row) {
  v1::DistrustedWorker out;
  out.set_worker(row.worker);
  out.set_since_unix_ms(row.since_unix_ms);
  out.set_reason(row.reason);
  return out;
}

v1::WorkerStatus to_message(const WorkerStatus& status) {
  const WorkerRow& r = status.row;
  v1::WorkerStatus out;
  out.set_id(r.id);
  out.set_name(r.name);
  out.set_state(status.state);
  out.set_threads(r.threads);
  out.set_build_id(r.build_id);
  out.set_host(r.host);
  out.set_units_merged(r.units_merged);
  out.set_units_failed(r.units_failed);
  out.set_last_seen_unix_ms(r.last_seen_unix_ms);
  out.set_message(status.message);
  out.set_resident_bytes(status.resident_bytes);
  set_failures(status.failures, *out.mutable_failures());
  for (const std::string& job : status.jobs) out.add_jobs(job);
  for (const JobName& job : status.work) *out.add_work() = to_message(job);
  return out;
}

v1::JobReport to_message(const JobReport& report) {
  v1::JobReport out;
  out.set_job_id(report.job_id);
  out.set_name(report.name);
  if (report.state) out.set_state(to_message(*report.state));
  out.set_iterations(report.iterations);
  out.set_lost(report.lost);
  for (const JobReport::Finding& f : report.findings) {
    v1::Finding& finding = *out.add_findings();
    finding.set_part(f.part);
    finding.set_text(f.text);
    finding.set_mend(f.mend);
  }
  return out;
}

v1::GetLedgerResponse to_message(const Ledger& ledger) {
  v1::GetLedgerResponse out;
  for (const UnitRow& u : ledger.merged) {
    v1::LedgerRow& row = *out.add_merged();
    row.set_unit_id(u.id);
    wire::to_proto(u.unit, *row.mutable_unit());
    row.set_worker_id(u.worker_id);
    row.set_token(u.token);
  }
  for (const Ledger::Range& r : ledger.film) {
    v1::IterationRange& range = *out.add_film();
    range.set_half(r.half);
    range.set_begin(r.begin);
    range.set_end(r.end);
  }
  out.set_film_eye_samples(ledger.film_eye_samples);
  out.set_chain_segments(ledger.chain_segments);
  return out;
}

v1::DeltaVerdict to_message(DeltaVerdict verdict) {
  static_assert(v1::DELTA_VERDICT_MERGED == static_cast<int>(DeltaVerdict::merged) + 1 &&
                v1::DELTA_VERDICT_JOB_ENDED == static_cast<int>(DeltaVerdict::job_ended) + 1);
  return static_cast<v1::DeltaVerdict>(static_cast<int>(verdict) + 1);
}

Result<DeltaHeader> from_message(const v1::DeltaHeader& header) {
  CANDELA_ASSIGN(const Unit unit, wire::from_proto(header.unit()));
  if (!is_sha256_hex(header.sha256()))
    return input_error("must be 64 lower-case hex digits").with_field("header.sha256");
  if (!(header.render_seconds() >= 0) || header.render_seconds() > 1e9)
    return input_error("must be seconds, 0 or more").with_field("header.render_seconds");
  return DeltaHeader{header.worker_id(), header.job_id(), header.token(),      header.unit_id(),       unit,
                     header.build_id(),  header.sha256(), header.size_bytes(), header.render_seconds()};
}

}  // namespace candela::master
