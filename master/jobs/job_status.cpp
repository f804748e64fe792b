#include "master/jobs/job_status.h"

#include <limits>

namespace candela::master {

std::vector<std::string> JobStatus::layers() const {
  const std::span<const std::string> all = row.layers;
  if (!row.chains) return row.layers;
  return chains::shown_layers(all.subspan(chains::kImageLayers - 1));
}

std::array<std::uint64_t, film::kRejectCauses> JobStatus::rejected() const {
  std::array<std::uint64_t, film::kRejectCauses> out = row.bootstrap_rejected;
  for (std::size_t i = 0; i < out.size(); ++i) out[i] += row.tallies.rejected[i];
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
  return out;
}

std::string message_of(const Scheduler& scheduler, const WorkerState& w, Now t) {
  if (w.distrusted) return scheduler.distrusted().at(identity(w.row)).reason;
  const std::string stuck = scheduler.stuck_text(w, t);
  return stuck.empty() ? w.message : stuck;
}

WorkerStatus status_of(const Scheduler& scheduler, const WorkerState& w, Now t) {
  return {w.row,
          scheduler.worker_state_name(w, t),
          message_of(scheduler, w, t),
          w.failures,
          w.resident_bytes,
          scheduler.jobs_of(w)};
}

}  // namespace candela::master
