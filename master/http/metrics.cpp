// Metrics for Prometheus. Figures are gathered when it asks.
#include <prometheus/counter.h>
#include <prometheus/gauge.h>
#include <prometheus/registry.h>
#include <prometheus/text_serializer.h>

#include <cmath>
#include <map>
#include <sstream>

#include "common/base/version.h"
#include "master/farm.h"
#include "master/http/http_server.h"

namespace candela::master {
namespace {

using Labels = std::map<std::string, std::string>;

class Page {
 public:
  void gauge(const std::string& name, const std::string& help, double value, const Labels& labels = {}) {
    prometheus::BuildGauge().Name(name).Help(help).Register(registry_).Add(labels).Set(value);
  }
  void counter(const std::string& name, const std::string& help, double value, const Labels& labels = {}) {
    prometheus::BuildCounter().Name(name).Help(help).Register(registry_).Add(labels).Increment(value);
  }
  std::string text() const {
    std::ostringstream out;
    prometheus::TextSerializer().Serialize(out, registry_.Collect());
    return out.str();
  }

 private:
  // Families of one name are merged, not refused.
  prometheus::Registry registry_{prometheus::Registry::InsertBehavior::Merge};
};

void add_chains(Page& page, const JobStatus& j, const Labels& labels) {
  page.gauge("candela_job_bootstrap_samples", "bootstrap samples done", static_cast<double>(j.bootstrap_done),
             labels);
  if (!j.row.named_state) return;
  const chains::Normalisation b = j.normalisation();
  page.gauge("candela_job_b", "normalization constant of Markov chains", b.b, labels);
  page.gauge("candela_job_b_standard_error", "of the normalization constant", b.standard_error, labels);
  page.gauge("candela_job_b_samples", "samples behind the normalization constant",
             static_cast<double>(b.samples), labels);
  for (std::size_t i = 0; i < j.row.chain_summary.groups.size(); ++i) {
    const chains::ChainCounts& g = j.row.chain_summary.groups[i];
    Labels group = labels;
    group["group"] = std::to_string(i);
    page.gauge("candela_job_mutations", "mutations merged, by group of chains",
               static_cast<double>(g.mutations), group);
    page.gauge("candela_job_mutations_accepted", "of those, accepted", static_cast<double>(g.accepted),
               group);
    page.gauge("candela_job_large_steps", "of those, large steps", static_cast<double>(g.large_steps), group);
    page.gauge("candela_job_longest_stay", "mutations in a row that left a chain where it was",
               static_cast<double>(g.longest_stay), group);
  }
}

void add_epochs(Page& page, const EpochStatus& e, const Labels& labels) {
  page.gauge("candela_job_epoch", "epoch of the newest decided state", static_cast<double>(e.epoch), labels);
  page.gauge("candela_job_statistics_bytes", "statistics in memory", static_cast<double>(e.statistics_bytes),
             labels);
  for (const auto& [name, value] : e.figures) {
    Labels one = labels;
    one["figure"] = name;
    page.gauge("candela_job_state", "figures of the newest decided state and of the job's merges", value,
               one);
  }
}

}  // namespace

std::string metrics_text(Farm& farm) {
  Page page;
  page.gauge("candela_build_info", "1, labeled with version and build", 1,
             {{"version", std::string(version())}, {"build", std::string(build_id())}});
  FarmCounters& c = farm.counters();
  for (std::size_t v = 0; v < kDeltaVerdicts; ++v)
    page.counter("candela_deltas_total", "deltas by verdict", static_cast<double>(c.verdicts[v]),
                 {{"verdict", std::string(name(static_cast<DeltaVerdict>(v)))}});
  page.counter("candela_delta_bytes_total", "bytes of deltas received whole",
               static_cast<double>(c.delta_bytes));
  page.counter("candela_merge_seconds_total", "time spent decoding and merging",
               static_cast<double>(c.merge_microseconds) * 1e-6);
  page.counter("candela_queue_full_total", "deltas told to come again", static_cast<double>(c.queue_full));
  page.counter("candela_leases_total", "leases granted", static_cast<double>(c.leases));
  page.counter("candela_checkpoints_total", "checkpoints written", static_cast<double>(c.checkpoints));
  page.counter("candela_checkpoint_failures_total", "checkpoints that could not be written",
               static_cast<double>(c.checkpoint_failures));
  page.counter("candela_damaged_blobs_total", "blobs that were found damaged and set aside",
               static_cast<double>(c.damaged_blobs));
  page.counter("candela_upload_bytes_total", "bytes of scene files uploaded",
               static_cast<double>(c.upload_bytes));
  page.counter("candela_jobs_removed_total", "jobs removed as --keep-finished says",
               static_cast<double>(c.jobs_removed));
  page.counter("candela_blobs_collected_total", "scene files removed that no job needed",
               static_cast<double>(c.blobs_collected));
  page.counter("candela_blob_bytes_collected_total", "bytes of those",
               static_cast<double>(c.blob_bytes_collected));
  page.gauge("candela_blobs", "scene files that the latest collection kept", static_cast<double>(c.blobs));
  page.gauge("candela_blob_bytes", "bytes of those", static_cast<double>(c.blob_bytes));
  for (const auto& [result, n] :
       {std::pair("sent", &c.notices.sent), {"refused", &c.notices.refused}, {"dropped", &c.notices.dropped}})
    page.counter("candela_notices_total", "notices by what came of them", static_cast<double>(*n),
                 {{"result", result}});
  page.counter("candela_notice_retries_total", "tries of notices that failed and come again",
               static_cast<double>(c.notices.retries));
  page.gauge("candela_merge_queue_bytes", "bytes of deltas under way",
             static_cast<double>(farm.gate().bytes_under_way()));
  page.gauge("candela_merge_queue_limit_bytes", "maximum bytes of deltas in flight",
             static_cast<double>(farm.options().master.merge_queue_bytes));
  page.gauge("candela_store_backlog", "changes waiting to be written",
             static_cast<double>(farm.writer().backlog()));
  struct Leases {
    double held = 0, expired = 0;
    FailureCounts failures{};
    Wanted wanted;
    AuditCounts audits;
    double units_held = 0, distrusted = 0;
  };
  const Leases leases = farm.with_scheduler([&](Scheduler& s) {
    Leases out{static_cast<double>(s.lease_count()), static_cast<double>(s.expired_count()), s.failures(),
               s.wanted(farm.now()), s.audit_counts()};
    for (const auto& [id, job] : s.jobs()) out.units_held += static_cast<double>(job.held.size());
    out.distrusted = static_cast<double>(s.distrusted().size());
    return out;
  });
  for (const auto& [result, n] : {std::pair("equal", leases.audits.equal),
                                  {"disputed", leases.audits.disputes},
                                  {"alone", leases.audits.alone},
                                  {"rechecked", leases.audits.rechecked}})
    page.counter("candela_audits_total",
                 "units that were to be rendered by a second worker, by what came of it",
                 static_cast<double>(n), {{"result", result}});
  page.counter("candela_jobs_begun_anew_total", "jobs that had merged false samples",
               static_cast<double>(leases.audits.anew));
  page.gauge("candela_units_held", "units that wait for the answer of a second worker", leases.units_held);
  page.gauge("candela_workers_distrusted", "workers that are distrusted, those that are away included",
             leases.distrusted);
  for (const FailureCause cause : kAllFailureCauses)
    page.counter("candela_unit_failures_total", "units that failed, by cause",
                 static_cast<double>(leases.failures[index_of(cause)]),
                 {{"cause", std::string(name(cause))}});
  page.gauge("candela_leases", "leases held now", leases.held);
  page.counter("candela_leases_expired_total", "leases that ran out", leases.expired);
  page.gauge("candela_threads_wanted", "threads that the open jobs could use now",
             static_cast<double>(leases.wanted.threads));
  page.gauge("candela_workers_wanted", "workers of the present size that the open jobs could use now",
             static_cast<double>(leases.wanted.workers));

  std::map<std::string, int> jobs, workers;
  for (const JobState s : {JobState::queued, JobState::running, JobState::paused, JobState::done,
                           JobState::failed, JobState::cancelled})
    jobs[std::string(name(s))] = 0;
  for (const char* s : {"idle", "busy", "draining", "drained", "pausing", "paused", "set-aside", "distrusted",
                        "stuck", "awaited", "lost"})
    workers[s] = 0;
  farm.with_scheduler([&](Scheduler& s) {
    for (const auto& [id, job] : s.jobs()) ++jobs[std::string(name(job.row.state))];
  });
  for (const JobStatus& j : farm.open_status()) {
    const Labels labels{{"job", j.row.id}};
    page.gauge("candela_job_waiting_units", "units that failed and wait for another attempt",
               static_cast<double>(j.waiting ? j.waiting->units : 0), labels);
    page.gauge("candela_job_iterations", "iterations merged", static_cast<double>(j.iterations()), labels);
    page.gauge("candela_job_samples", "eye samples merged",
               static_cast<double>(j.row.sample_counts.eye_samples), labels);
    page.gauge("candela_job_samples_per_second", "over the last seconds", j.samples_per_second, labels);
    page.gauge("candela_job_checkpoint_iterations", "iterations in the newest checkpoint",
               static_cast<double>(j.checkpoint_iterations()), labels);
    if (j.row.chains) add_chains(page, j, labels);
    if (const auto epochs = farm.epoch_status(j.row.id)) add_epochs(page, *epochs, labels);
    if (!std::isnan(j.row.relmse))
      page.gauge("candela_job_relmse", "estimated relative mean squared error", j.row.relmse, labels);
    if (!std::isnan(j.row.relmse_upper))
      page.gauge("candela_job_relmse_upper", "upper end of the error's 95 % interval, by which jobs stop",
                 j.row.relmse_upper, labels);
  }
  for (const WorkerStatus& w : farm.all_workers()) ++workers[w.state];
  for (const auto& [state, n] : jobs) page.gauge("candela_jobs", "jobs by state", n, {{"state", state}});
  for (const auto& [state, n] : workers)
    page.gauge("candela_workers", "workers by state", n, {{"state", state}});
  return page.text();
}

}  // namespace candela::master
