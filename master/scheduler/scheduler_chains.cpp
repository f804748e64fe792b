// Jobs of Markov chains: their bootstrap, and which of their segments can be rendered.
#include <fmt/format.h>

#include <algorithm>

#include "common/chains/growth.h"
#include "master/scheduler/scheduler.h"

namespace candela::master {
Result<bool> Scheduler::complete_bootstrap(const std::string& worker_id, std::uint64_t token,
                                           std::vector<float> contributions,
                                           const std::array<std::uint64_t, film::kRejectCauses>& rejected,
                                           double render_seconds, Now now) {
  expire(now);
  const auto it = leases_.find(token);
  if (it == leases_.end() || it->second.row.worker_id != worker_id) return false;
  Job* job = find(it->second.row.job_id);
  if (job == nullptr || !job->in_bootstrap() || job->finishing || has_ended(job->row.state)) return false;
  const auto u = job->units.find(it->second.row.unit_id);
  if (u == job->units.end()) return false;
  const Unit unit = u->second.row.unit;
  CANDELA_TRY(job->source->add(unit, contributions));

  WorkerState& worker = workers_.at(worker_id);
  worker.row.units_merged += 1;
  note_success(*job, worker, now);
  job->served() += (render_seconds - it->second.row.expected_seconds) / job->row.share;
  const std::uint64_t unit_id = u->first;
  std::vector<std::string> by{identity(worker.row)};
  if (const auto& audit = u->second.audit) {
    for (const AuditAnswer& answer : audit->answers) by.push_back(answer.worker);
    note_compared(*audit);
  }
  for (const std::string& who : by)
    if (std::vector<std::string>& all = job->row.audit.bootstrap_by;
        std::find(all.begin(), all.end(), who) == all.end())
      all.push_back(who);
  const std::vector<std::uint64_t> tokens = u->second.leases;
  for (const std::uint64_t t : tokens) drop_lease(t, now, t != token);
  job->units.erase(unit_id);
  job->held.erase(unit_id);
  changes_.emplace_back(DropUnit{unit_id});
  changes_.emplace_back(PutBootstrap{{job->row.id, unit.begin, std::move(contributions), rejected}});
  for (std::size_t i = 0; i < rejected.size(); ++i) job->row.bootstrap_rejected[i] += rejected[i];
  job->row.worker_seconds += render_seconds;
  note_build(*job, now);
  note_cost(*job, worker, unit, render_seconds);
  last_activity_ = now.seconds;
  if (job->source->table()->complete())
    bootstrapped(*job, now);
  else
    save(*job, now);
  return true;
}

// The bootstrap is complete: b0, the film's scale and the chains' starts follow from it and the seed alone.
void Scheduler::bootstrapped(Job& job, Now now) {
  const ChainPlan& plan = *job.row.chains;
  const chains::BootstrapTable& table = *job.source->table();
  job.row.bootstrap = table.sums();
  const chains::Normalisation b = table.normalisation();
  job.starts = table.choose_starts(plan.chains, job.row.settings.seed);
  job.row.named_state = NamedState{chains::film_scale_log2(b.b, job.row.pilot_scale_log2), b.b};
  job.row.chain_summary = chains::summarise(job.row.bootstrap, {});
  job.source = make_source(job.row);
  place_prefix(job);
  rebuild_reserved(job);
  event(now, job.row.id, "", "bootstrap",
        fmt::format("b = {:.6g} +- {:.2g} from {} samples, film scale 2^{}", b.b, b.standard_error, b.samples,
                    job.row.named_state->film_scale_log2));
  changes_.emplace_back(PutStarts{job.row.id, job.starts});
  save(job, now);
}

void Scheduler::restore_chains(Job& job, const RestoredStages& restored, Now now) {
  if (!job.row.chains) return;
  job.record_bytes = restored.record_bytes;
  job.reported_stay = chains::longest_stay(job.row.chain_summary).longest_stay;
  job.starts = restored.starts;
  if (!job.in_bootstrap()) return;
  job.row.bootstrap_rejected = {};
  for (const BootstrapRow& row : restored.bootstrap) {
    const Unit unit{job.source->kind(), 0, row.begin, row.begin + row.contributions.size()};
    if (!job.source->add(unit, row.contributions).ok()) continue;  // it will be made again
    for (std::size_t i = 0; i < row.rejected.size(); ++i) job.row.bootstrap_rejected[i] += row.rejected[i];
  }
  if (job.source->table()->complete()) bootstrapped(job, now);
}

std::string Scheduler::chain_message(const JobRow& row) {
  if (!row.chains || !row.named_state) return {};
  if (!(row.named_state->bootstrap_b > 0))
    return fmt::format(
        "none of {} bootstrap samples found light: the image holds only what needs no chain; if there is "
        "more, submit the job again with more bootstrap samples",
        row.bootstrap.samples);
  const std::string grown = chains::grown_b_text(row.bootstrap, row.chain_summary.normalisation),
                    stay = chains::long_stay_text(row.chain_summary);
  return grown + (grown.empty() || stay.empty() ? "" : "; ") + stay;
}

void Scheduler::found_black(const std::string& id, Now now) {
  Job* job = find(id);
  if (job == nullptr || job->finishing || has_ended(job->row.state)) return;
  stop(*job, "black", now);
}

void Scheduler::chains_summarised(const std::string& id, const chains::Summary& summary, Now now) {
  Job* job = find(id);
  if (job == nullptr) return;
  const std::uint64_t after = chains::longest_stay(summary).longest_stay;
  job->row.chain_summary = summary;
  // Once, and again at each doubling: a chain may be stuck for hours.
  const std::string text = chains::long_stay_text(summary);
  if (text.empty() || after < 2 * job->reported_stay) return;
  job->reported_stay = after;
  event(now, id, "", "long-stay", text);
}

}  // namespace candela::master
