#include "master/jobs/job_status.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

namespace candela::master {

std::vector<std::string> JobStatus::layers() const {
  const std::span<const std::string> all = row.layers;
  if (!row.chains) return row.layers;
  return chains::shown_layers(all.subspan(chains::kImageLayers - 1));
}

std::array<std::uint64_t, film::kRejectCauses> JobStatus::rejected() const {
  std::array<std::uint64_t, film::kRejectCauses> out = row.bootstrap_rejected;
  for (std::size_t i = 0; i < out.size(); ++i) out[i] += row.sample_counts.rejected[i];
  return out;
}

chains::Normalisation JobStatus::normalisation() const {
  chains::Normalisation out = row.chain_summary.normalisation;
  if (!row.named_state) out.b = out.standard_error = std::numeric_limits<double>::quiet_NaN();
  return out;
}

JobStatus status_of(const Scheduler& scheduler, const Job& job, Now t) {
  const JobRow& r = job.row;
  JobStatus out;
  out.row = r;
  out.message = scheduler.message_of(job, t);
  out.failures = job.failures;
  out.waiting = scheduler.waiting_of(job, t);
  if (!has_ended(r.state)) {  // thousands of others have no leases to be looked for
    out.units_leased = scheduler.leases_of(r.id);
    out.worker_memory_bytes = scheduler.worker_memory_of(r.id);
  }
  if (r.chains) {
    const chains::BootstrapTable* table = job.source->table();
    out.bootstrap_done = table != nullptr ? table->known().count() : r.chains->bootstrap_samples;
  }
  out.lost = count(job.lost());
  out.samples_per_second = scheduler.samples_per_second(job, t);
  out.eta_seconds = scheduler.eta_seconds(job, t);
  out.short_id = scheduler.short_id(r.id);
  if (job.leases > 0) out.workers = scheduler.workers_of({r.id});
  return out;
}

JobName name_of(const Scheduler& scheduler, const Job& job) {
  const JobRow& r = job.row;
  return {r.id, scheduler.short_id(r.id), r.name, r.submitter, r.state, r.submitted_unix_ms, false};
}

namespace {

// Fraction of the work that the job asks for. Few jobs know the error, which also ends jobs.
double fraction_done(const JobRow& row) {
  if (row.state == JobState::done) return 1;
  double fraction = 0;
  if (const std::uint64_t asked = row.iterations_asked(); asked > 0)
    fraction = static_cast<double>(row.iterations_of(row.iterations)) / static_cast<double>(asked);
  if (row.stop.time_seconds > 0) fraction = std::max(fraction, row.elapsed_seconds / row.stop.time_seconds);
  if (row.stop.relmse > 0 && row.relmse_upper > 0)
    fraction = std::max(fraction, row.stop.relmse / row.relmse_upper);
  return std::clamp(fraction, 0.0, 1.0);
}

JobState state_of(const std::map<JobState, std::uint32_t>& states) {
  for (const JobState state :
       {JobState::running, JobState::queued, JobState::paused, JobState::failed, JobState::cancelled})
    if (states.contains(state)) return state;
  return JobState::done;
}

}  // namespace

JobName name_of_group(const Scheduler& scheduler, const std::string& group_id) {
  const GroupState& group = scheduler.groups().at(group_id);
  std::map<JobState, std::uint32_t> states;
  for (const std::string& id : group.jobs) ++states[scheduler.jobs().at(id).row.state];
  const JobRow& row = scheduler.jobs().at(*group.jobs.begin()).row;
  return {group_id,
          scheduler.short_id(group_id),
          row.frame->group_name,
          row.submitter,
          state_of(states),
          group.submitted_unix_ms,
          true};
}

GroupStatus status_of_group(const Scheduler& scheduler, const std::string& group_id, Now t) {
  const GroupState& group = scheduler.groups().at(group_id);
  GroupStatus out;
  out.name = name_of_group(scheduler, group_id);
  std::vector<const Job*> jobs;
  for (const std::string& id : group.jobs) jobs.push_back(&scheduler.jobs().at(id));
  std::sort(jobs.begin(), jobs.end(),
            [](const Job* a, const Job* b) { return a->row.frame->frame < b->row.frame->frame; });
  out.frames = static_cast<std::uint32_t>(jobs.size());
  out.first_frame = jobs.front()->row.frame->frame;
  out.last_frame = jobs.back()->row.frame->frame;
  const Job* failed = nullptr;
  const Job* waiting = nullptr;
  std::optional<std::int32_t> priority;
  double fraction = 0;
  for (const Job* job : jobs) {
    const JobRow& row = job->row;
    ++out.states[row.state];
    out.frames_submitted = std::max(out.frames_submitted, row.frame->frames);
    if (!has_ended(row.state)) priority = std::max(priority.value_or(row.priority), row.priority);
    fraction += fraction_done(row);
    out.worker_seconds += row.worker_seconds;
    out.finished_unix_ms = std::max(out.finished_unix_ms, row.finished_unix_ms);
    out.depends.insert(row.depends.begin(), row.depends.end());
    if (failed == nullptr && row.state == JobState::failed) failed = job;
    if (waiting == nullptr && !has_ended(row.state)) waiting = job;
  }
  if (waiting != nullptr) out.finished_unix_ms = 0;
  out.priority = priority.value_or(jobs.front()->row.priority);
  out.share = jobs.front()->row.share;
  out.fraction_done = fraction / static_cast<double>(jobs.size());
  if (out.states.contains(JobState::running)) out.workers = scheduler.workers_of(group.jobs);
  out.eta_seconds = std::numeric_limits<double>::quiet_NaN();
  if (out.workers > 0 && out.fraction_done > 0)
    out.eta_seconds = out.worker_seconds * (1 / out.fraction_done - 1) / static_cast<double>(out.workers);
  const Job* told = failed != nullptr ? failed : waiting;
  if (told != nullptr) {
    const std::string text = scheduler.message_of(*told, t);
    if (!text.empty()) out.message = fmt::format("frame {}: {}", told->row.frame->frame, text);
  }
  return out;
}

std::string message_of(const Scheduler& scheduler, const WorkerState& w, Now t) {
  if (w.distrusted) return scheduler.distrusted().at(identity(w.row)).reason;
  const std::string stuck = scheduler.stuck_text(w, t);
  return stuck.empty() ? w.message : stuck;
}

WorkerStatus status_of(const Scheduler& scheduler, const WorkerState& w, Now t) {
  std::vector<JobName> work;
  for (const std::string& id : scheduler.jobs_of(w))
    if (const auto job = scheduler.jobs().find(id); job != scheduler.jobs().end())
      work.push_back(name_of(scheduler, job->second));
  return {w.row,
          scheduler.worker_state_name(w, t),
          message_of(scheduler, w, t),
          w.failures,
          w.resident_bytes,
          scheduler.jobs_of(w),
          std::move(work)};
}

}  // namespace candela::master
