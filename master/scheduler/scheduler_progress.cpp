// Workers that do not go on, and work that steps aside: leases without progress, units that are cut short for
// more urgent jobs, workers that are lost.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "common/base/version.h"
#include "master/scheduler/scheduler.h"

namespace candela::master {
namespace {

// Without progress, before a worker is called stuck; of the time after which its unit is given up at most
// this part.
constexpr double kTellSeconds = 60, kTellPart = 0.5;
// A worker hears within a heartbeat that a unit is taken away, and stops, or begins again, in ten seconds.
constexpr double kStopSeconds = 20;
constexpr double kWorthCutting = 1;  // seconds that a unit has to go, or more

bool computes(const Lease& lease) {
  return lease.phase && *lease.phase != WorkPhase::waiting;
}

std::string time_text(double seconds) {
  return seconds < 120 ? fmt::format("{:.3g} s", seconds) : fmt::format("{:.3g} min", seconds / 60);
}

}  // namespace

// Workers and deltas of another build are refused, so that all work is of the master's own.
void Scheduler::note_build(Job& job, Now now) {
  std::vector<std::string>& builds = job.row.builds;
  if (std::find(builds.begin(), builds.end(), build_id()) != builds.end()) return;
  if (!builds.empty())
    event(now, job.row.id, "", "build",
          fmt::format("goes on with build {}; it has work of build {}", build_id(), builds.back()));
  builds.emplace_back(build_id());
  save(job, now);
}

void Scheduler::note_steps(Lease& lease, const UnitReport& report, Now now) {
  if (lease.phase != report.phase || lease.steps != report.steps) lease.stepped = now.seconds;
  lease.phase = report.phase;
  lease.steps = report.steps;
}

std::string Scheduler::stuck_text(const WorkerState& worker, Now now) const {
  for (const auto& [token, left] : worker.leftovers)
    if (left.named && now.seconds - left.since > kStopSeconds)
      return fmt::format("told to stop a unit of job {} {} ago, and still {} for it", left.job_id,
                         time_text(now.seconds - left.since),
                         doing(left.phase.value_or(WorkPhase::rendering)));
  for (const std::uint64_t token : worker.leases) {
    const Lease& lease = leases_.at(token);
    const double still = now.seconds - lease.stepped;
    if (computes(lease) && still > std::min(kTellSeconds, kTellPart * options_.stuck_seconds))
      return fmt::format("no progress for {} while {} for job {}", time_text(still), doing(*lease.phase),
                         lease.row.job_id);
  }
  return {};
}

void Scheduler::give_up_stuck(Now now) {
  std::vector<std::uint64_t> stuck;
  for (const auto& [token, lease] : leases_)
    if (computes(lease) && now.seconds - lease.stepped > options_.stuck_seconds) {
      const auto worker = workers_.find(lease.row.worker_id);
      // A silent worker may or may not go on: nobody knows.
      if (worker != workers_.end() && now.seconds - worker->second.last_seen < options_.lease_seconds)
        stuck.push_back(token);
    }
  for (const std::uint64_t token : stuck) give_up_stuck(token, now);
}

void Scheduler::give_up_stuck(std::uint64_t token, Now now) {
  const auto it = leases_.find(token);
  if (it == leases_.end()) return;  // its job was given up for another of these leases
  const Lease lease = it->second;
  const WorkPhase phase = *lease.phase;
  WorkerState& worker = workers_.at(lease.row.worker_id);
  const std::string text =
      fmt::format("no progress for {} while {}", time_text(now.seconds - lease.stepped), doing(phase));
  event(now, lease.row.job_id, worker.row.id, "stuck", fmt::format("{}: {}", worker.row.name, text));
  if (Job* job = find(lease.row.job_id)) ++job->stuck[phase][identity(worker.row)];
  worker.leftovers[token] = {lease.row.job_id, now.seconds, true, phase};
  fail_unit(worker.row.id, token, FailureCause::worker, text, now);
  if (Job* job = find(lease.row.job_id)) end_if_stuck(*job, phase, now);
}

// A scene that holds two workers, or the only one twice, holds any.
bool Scheduler::end_if_stuck(Job& job, WorkPhase phase, Now now) {
  if (job.finishing || has_ended(job.row.state)) return false;
  const auto& workers = job.stuck[phase];
  const std::set<std::string> able = able_workers(job, true, now);
  const bool others =
      std::any_of(able.begin(), able.end(), [&](const std::string& name) { return !workers.contains(name); });
  const bool twice = std::any_of(workers.begin(), workers.end(), [](const auto& w) { return w.second >= 2; });
  if (workers.size() < 2 && (others || !twice)) return false;
  std::string names;
  for (const auto& [name, count] : workers) names += (names.empty() ? "" : ", ") + name;
  fail_job(job.row.id,
           fmt::format("no progress for {} while {}, on {} worker(s): {} (the scene asks for more than the "
                       "renderer can do in this time: make it smaller, or give the master a longer "
                       "--stuck-after; `candela resume {}` goes on from what is merged)",
                       time_text(options_.stuck_seconds), doing(phase), workers.size(), names, job.row.id),
           now);
  return true;
}

bool Scheduler::cut_leases(const WorkerState& worker, std::int64_t below_priority) {
  bool any = false;
  for (const std::uint64_t token : worker.leases) {
    Lease& lease = leases_.at(token);
    const Job* job = find(lease.row.job_id);
    if (lease.cut || job == nullptr || job->row.priority >= below_priority) continue;
    any = lease.cut = true;
  }
  return any;
}

std::int64_t Scheduler::highest_priority(const WorkerState& worker) {
  std::int64_t highest = std::numeric_limits<std::int64_t>::min();
  for (const std::uint64_t token : worker.leases)
    if (const Job* job = find(leases_.at(token).row.job_id))
      highest = std::max<std::int64_t>(highest, job->row.priority);
  return highest;
}

void Scheduler::ask_cuts(Now now) {
  std::int32_t lowest = std::numeric_limits<std::int32_t>::max();
  for (const auto& [token, lease] : leases_)
    if (const Job* job = find(lease.row.job_id)) lowest = std::min(lowest, job->row.priority);
  std::vector<Job*> urgent;
  for (auto& [id, job] : jobs_)
    if (job.open_for_leases() && job.row.priority > lowest) urgent.push_back(&job);
  if (urgent.empty()) return;
  std::stable_sort(urgent.begin(), urgent.end(),
                   [](const Job* a, const Job* b) { return a->row.priority > b->row.priority; });

  struct Place {
    WorkerState* worker;
    bool coming;            // idle, or soon
    std::int32_t priority;  // the highest of its leases
    double end;             // when these will be done
    double first_end = 0;   // and the one under way
    bool taken = false;
  };
  std::vector<Place> places;
  double threads = 0;
  for (auto& [id, w] : workers_) {
    if (!usable(w, now)) continue;
    Place place{&w, w.leases.empty(), std::numeric_limits<std::int32_t>::min(), now.seconds};
    for (const std::uint64_t token : w.leases) {
      const Lease& lease = leases_.at(token);
      place.coming |= lease.cut;
      const double end = lease.row.expected_seconds > 0 ? lease.granted + lease.due_seconds
                                                        : std::numeric_limits<double>::infinity();
      if (token == *w.leases.begin()) place.first_end = end;
      place.end = std::max(place.end, end);
      if (const Job* job = find(lease.row.job_id))
        place.priority = std::max(place.priority, job->row.priority);
    }
    places.push_back(place);
    threads += std::max(w.row.threads, 1U);
  }
  if (places.empty()) return;
  const double per_worker = threads / static_cast<double>(places.size());
  // Units of the lowest priority first, and among them those that would take longest.
  std::stable_sort(places.begin(), places.end(), [](const Place& a, const Place& b) {
    return a.priority != b.priority ? a.priority < b.priority : a.end > b.end;
  });
  for (Job* job : urgent) {
    auto missing = static_cast<std::int64_t>(std::ceil(useful_threads(*job, per_worker) / per_worker));
    const auto can = [&](const Place& place) {
      const auto standing = job->standings.find(place.worker->row.id);
      return !place.taken && can_run(*place.worker, *job) &&
             (standing == job->standings.end() || standing->second.retry_at <= now.seconds);
    };
    const auto cut = [&](const Place& place) {
      if (cut_leases(*place.worker, job->row.priority))
        event(now, job->row.id, place.worker->row.id, "cut",
              fmt::format("{} is asked to cut its unit short for this job", place.worker->row.name));
    };
    for (Place& place : places) {
      const bool has = std::any_of(place.worker->leases.begin(), place.worker->leases.end(),
                                   [&](std::uint64_t t) { return leases_.at(t).row.job_id == job->row.id; });
      if (!has && !(place.coming && can(place))) continue;
      place.taken = true;
      --missing;
      // The job's unit may wait there behind another one.
      if (has && place.first_end - now.seconds > kWorthCutting) cut(place);
    }
    for (Place& place : places) {
      if (missing <= 0) break;
      if (place.priority >= job->row.priority || !can(place) || place.end - now.seconds < kWorthCutting)
        continue;
      if (!has_work(*job, *place.worker, now)) continue;
      place.taken = true;
      --missing;
      cut(place);
    }
  }
}

void Scheduler::tell_losses(Now now) {
  for (auto& [id, w] : workers_) {
    if (w.told_of_loss || lives(w, now)) continue;
    w.told_of_loss = true;
    event(now, "", id, "lost",
          w.awaited
              ? fmt::format("{} on {} has not come back since the master started", w.row.name, w.row.host)
              : fmt::format("{} on {} has not been heard of for {}", w.row.name, w.row.host,
                            time_text(now.seconds - w.last_seen)));
  }
}

}  // namespace candela::master
