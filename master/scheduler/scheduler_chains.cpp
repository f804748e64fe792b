// Jobs of Markov chains: their bootstrap, and which of their segments can be rendered.
#include <fmt/format.h>

#include <algorithm>

#include "master/scheduler/free_segments.h"
#include "master/scheduler/scheduler.h"

namespace candela::master {
namespace {

// What chain records a lease may carry at most, by the largest record known.
constexpr std::size_t kMaxLeaseBytes = 2 << 20;
// A unit holds at most this part of the chains for each worker: one unit is rendered, one waits and one is on
// its way, and none of their chains can go on meanwhile.
constexpr std::uint64_t kUnitsPerWorker = 4;

}  // namespace

bool Job::ready(const Unit& unit) const {
  const std::uint64_t n = per_round();
  if (unit.half > 1 || unit.begin >= unit.end || unit.end - unit.begin > n) return false;
  if (unit.end <= n) return true;
  const auto [gap, gap_end] = merged[unit.half].first_gap(std::max(unit.begin, n) - n, unit.end - n);
  return gap == gap_end;
}

std::optional<Unit> Scheduler::next_samples(Job& job, std::uint64_t want) {
  const std::uint64_t samples = job.row.chains->bootstrap_samples;
  const auto [begin, end] = job.bootstrap_taken.first_gap(0, samples);
  if (begin == end) return std::nullopt;
  const Unit unit{Unit::Kind::bootstrap, 0, begin, std::min(end, begin + want)};
  job.bootstrap_taken.insert(unit.begin, unit.end);
  return unit;
}

// How many segments a unit of the job may have.
std::uint64_t Scheduler::most_segments(const Job& job, std::uint64_t active_workers) {
  const std::uint64_t share = job.row.chains->chains / (kUnitsPerWorker * active_workers);
  std::uint64_t most = std::min(job.per_round(), std::max<std::uint64_t>(share, 1));
  if (job.record_bytes > 0)
    most = std::min<std::uint64_t>(most, std::max<std::size_t>(kMaxLeaseBytes / job.record_bytes, 1));
  return most;
}

std::optional<Unit> Scheduler::next_segments(Job& job, std::uint64_t want, std::uint64_t active_workers) {
  want = std::min(want, most_segments(job, active_workers));
  // The halves advance together, so that an error estimate is there early.
  std::uint32_t half = job.taken[0].count() <= job.taken[1].count() ? 0 : 1;
  for (int i = 0; i < 2; ++i, half = 1 - half) {
    const SegmentRun run =
        free_segments(job.merged[half], job.taken[half], job.per_round(), job.target(half), want);
    if (run.length == 0) continue;
    const Unit unit{Unit::Kind::segments, half, run.begin, run.begin + std::min(run.length, want)};
    job.taken[half].insert(unit.begin, unit.end);
    return unit;
  }
  return std::nullopt;
}

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
  if (u == job->units.end() || u->second.row.unit.kind != Unit::Kind::bootstrap) return false;
  const Unit unit = u->second.row.unit;
  const std::uint64_t samples = unit.end - unit.begin;
  if (contributions.size() != samples)
    return input_error(
               fmt::format("{} contributions, the unit has {} samples", contributions.size(), samples))
        .with_field("contributions");
  CANDELA_TRY(job->table->insert(unit.begin, contributions));

  WorkerState& worker = workers_.at(worker_id);
  worker.row.units_merged += 1;
  note_success(*job, worker, now);
  job->virtual_time += (render_seconds - it->second.row.expected_seconds) / job->row.share;
  const std::uint64_t unit_id = u->first;
  const std::vector<std::uint64_t> tokens = u->second.leases;
  for (const std::uint64_t t : tokens) drop_lease(t, now, t != token);
  job->units.erase(unit_id);
  changes_.emplace_back(DropUnit{unit_id});
  changes_.emplace_back(PutBootstrap{{job->row.id, unit.begin, std::move(contributions), rejected}});
  for (std::size_t i = 0; i < rejected.size(); ++i) job->row.bootstrap_rejected[i] += rejected[i];
  job->row.worker_seconds += render_seconds;
  const double per_sample = render_seconds / static_cast<double>(samples);
  const double per_iteration = per_sample * static_cast<double>(job->row.chains->segment_mutations);
  if (per_iteration > 0) {
    blend(job->worker_seconds_per_iteration[worker_id], per_iteration);
    blend(job->thread_seconds, per_iteration * worker.row.threads);
    job->row.thread_seconds_per_iteration = job->thread_seconds;
  }
  last_activity_ = now.seconds;
  if (job->table->complete())
    bootstrapped(*job, now);
  else
    save(*job, now);
  return true;
}

// The bootstrap is complete: b0, the film's scale and the chains' starts follow from it and the seed alone.
void Scheduler::bootstrapped(Job& job, Now now) {
  const ChainPlan& plan = *job.row.chains;
  job.row.bootstrap = job.table->sums();
  const chains::Normalisation b = job.table->normalisation();
  job.starts = job.table->choose_starts(plan.chains, job.row.settings.seed);
  job.row.named_state = NamedState{chains::film_scale_log2(b.b, job.row.pilot_scale_log2), b.b};
  job.row.chain_summary = chains::summarise(job.row.bootstrap, {});
  job.table.reset();
  retake(job);
  event(now, job.row.id, "", "bootstrap",
        fmt::format("b = {:.6g} +- {:.2g} from {} samples, film scale 2^{}", b.b, b.standard_error, b.samples,
                    job.row.named_state->film_scale_log2));
  changes_.emplace_back(PutStarts{job.row.id, job.starts});
  save(job, now);
}

void Scheduler::restore_chains(Job& job, const RestoredChains& restored, Now now) {
  if (!job.row.chains) return;
  job.record_bytes = restored.record_bytes;
  job.told_stay = chains::longest_stay(job.row.chain_summary).longest_stay;
  job.starts = restored.starts;
  if (!job.in_bootstrap()) return;
  job.table.emplace(job.row.chains->bootstrap_samples);
  job.row.bootstrap_rejected = {};
  for (const BootstrapRow& row : restored.bootstrap) {
    if (!job.table->insert(row.begin, row.contributions).ok()) continue;  // it will be made again
    for (std::size_t i = 0; i < row.rejected.size(); ++i) job.row.bootstrap_rejected[i] += row.rejected[i];
  }
  if (job.table->complete()) bootstrapped(job, now);
}

std::string Scheduler::chain_message(const JobRow& row) {
  if (!row.chains || !row.named_state) return {};
  if (!(row.named_state->bootstrap_b > 0))
    return fmt::format(
        "none of {} bootstrap samples found light: the image holds only what needs no chain; if there is "
        "more, submit the job again with more bootstrap samples",
        row.bootstrap.samples);
  return chains::long_stay_text(row.chain_summary);
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
  if (text.empty() || after < 2 * job->told_stay) return;
  job->told_stay = after;
  event(now, id, "", "long-stay", text);
}

}  // namespace candela::master
