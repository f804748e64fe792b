// Failed units: who is to blame, who waits, what is told, and when a job is given up (failure.h).
#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "master/scheduler/scheduler.h"

namespace candela::master {
namespace {

// One lease lost with its worker is everyday life; a second one of the same unit is worth a word.
bool is_worth_telling(const UnitTrouble& trouble) {
  return trouble.lost >= 2 ||
         std::any_of(trouble.failures.begin(), trouble.failures.end(), [](std::uint32_t n) { return n > 0; });
}

std::string place_of(const UnitTrouble& trouble) {
  switch (trouble.cause) {
    case FailureCause::scene:
      return fmt::format("worker {} says that the scene cannot be used, another is asked",
                         trouble.worker_name);
    case FailureCause::network:
      return fmt::format("network trouble between worker {} and the master", trouble.worker_name);
    case FailureCause::master:
      return "master trouble";
    case FailureCause::worker:
    case FailureCause::place:
      return fmt::format("{} trouble on worker {}", name(trouble.cause), trouble.worker_name);
  }
  return {};
}

}  // namespace

std::set<std::string> Scheduler::able_workers(const Job& job, bool all, Now now) const {
  std::set<std::string> out;
  for (const auto& [id, w] : workers_)
    if (can_run(w, job) && (all ? takes_part(w, now) : usable(w, now))) out.insert(identity(w.row));
  return out;
}

bool Scheduler::barred(const Job& job, const UnitState& unit, const WorkerState& worker, Now now) const {
  if (!unit.trouble || !unit.trouble->by_worker.contains(worker.row.id)) return false;
  return std::any_of(workers_.begin(), workers_.end(), [&](const auto& entry) {
    return usable(entry.second, now) && can_run(entry.second, job) &&
           !unit.trouble->by_worker.contains(entry.first);
  });
}

void Scheduler::note_success(Job& job, WorkerState& worker, Now now) {
  worker.consecutive_failures = 0;
  worker.times_set_aside = 0;
  worker.failed_jobs.clear();
  if (worker.set_aside_until <= now.seconds) worker.message.clear();
  job.standings.erase(worker.row.id);
  for (auto& [phase, workers] : job.stuck) workers.erase(identity(worker.row));
  job.told_waiting = false;
  if (job.refused_by.empty()) return;
  event(now, job.row.id, worker.row.id, "scene-disputed",
        fmt::format("{} worker(s) said that the scene cannot be used, and {} has rendered some of it",
                    job.refused_by.size(), worker.row.name));
  job.refused_by.clear();
}

UnitTrouble& Scheduler::blame(UnitState& unit, FailureCause cause, const WorkerState* worker,
                              const std::string& message) {
  if (!unit.trouble) unit.trouble.emplace();
  UnitTrouble& trouble = *unit.trouble;
  trouble.cause = cause;
  trouble.worker_name = worker != nullptr ? worker->row.name : "";
  trouble.text = message;
  if (worker == nullptr) return trouble;
  if (cause == FailureCause::scene || cause == FailureCause::worker) ++trouble.by_worker[worker->row.id];
  if (cause == FailureCause::scene) {
    trouble.refused_by.insert(identity(worker->row));
    trouble.refusal = message;
  }
  if (cause == FailureCause::worker) trouble.witnesses.insert(identity(worker->row));
  return trouble;
}

void Scheduler::note_failure(Job& job, WorkerState& worker, FailureCause cause, const std::string& message,
                             const Consequence& then, Now now) {
  ++worker.failures[index_of(cause)];
  worker.message = fmt::format("{}: {}", name(cause), message);
  if (is_workers_own(cause) || cause == FailureCause::network) ++worker.row.units_failed;
  changes_.emplace_back(PutWorker{worker.row});
  job.standings[worker.row.id].retry_at = now.seconds + then.worker_wait;
  if (!(then.set_aside > 0)) return;
  worker.set_aside_until = now.seconds + then.set_aside;
  active_.clear();
  ++worker.times_set_aside;
  worker.message =
      fmt::format("{} failures in a row on {} job(s), tried again after {:.0f} s; the last, {}",
                  worker.consecutive_failures, worker.failed_jobs.size(), then.set_aside, worker.message);
  event(now, "", worker.row.id, "set-aside", worker.message);
}

void Scheduler::fail_unit(const std::string& worker_id, std::uint64_t token, FailureCause cause,
                          const std::string& message, Now now) {
  expire(now);
  const auto it = leases_.find(token);
  if (it == leases_.end() || it->second.row.worker_id != worker_id) return;
  const std::string job_id = it->second.row.job_id;
  const std::uint64_t unit_id = it->second.row.unit_id;
  drop_lease(token, now, true);
  last_activity_ = now.seconds;
  Job* job = find(job_id);
  if (job == nullptr || has_ended(job->row.state)) return;
  ++failures_[index_of(cause)];
  ++job->failures[index_of(cause)];

  WorkerState& worker = workers_.at(worker_id);
  if (is_workers_own(cause)) {
    ++worker.consecutive_failures;
    worker.failed_jobs.insert(job_id);
  }
  FailureHistory history;
  history.cause = cause;
  history.unit_id = unit_id;
  history.worker_id = worker_id;
  history.at_job = ++job->standings[worker_id].failures;
  history.own = worker.consecutive_failures;
  history.own_jobs = static_cast<std::uint32_t>(worker.failed_jobs.size());
  history.times_set_aside = worker.times_set_aside;
  UnitState* unit = nullptr;
  if (const auto u = job->units.find(unit_id); u != job->units.end()) {
    unit = &u->second;
    history.of_unit = ++blame(*unit, cause, &worker, message).failures[index_of(cause)];
    if (cause == FailureCause::worker) ++unit->row.failures;
    save(*unit);
  }
  const Consequence then = consequence(history, options_.failures);
  if (unit != nullptr) unit->trouble->retry_at = now.seconds + then.unit_wait;
  event(now, job_id, worker_id, "unit-failed", fmt::format("{}: unit {}: {}", name(cause), unit_id, message));
  note_failure(*job, worker, cause, message, then, now);

  if (cause == FailureCause::scene) job->refused_by.insert(identity(worker.row));
  if (end_if_refused(*job, now)) return;
  if (unit != nullptr && end_if_poison(*job, *unit, now)) return;
  tell_waiting(*job, now);
}

void Scheduler::lack_inputs(const std::string& worker_id, std::uint64_t token, const std::string& message,
                            Now now) {
  const auto it = leases_.find(token);
  if (it == leases_.end() || it->second.row.worker_id != worker_id) return;
  const std::string job_id = it->second.row.job_id;
  const std::uint64_t unit_id = it->second.row.unit_id;
  drop_lease(token, now, true);
  Job* job = find(job_id);
  if (job == nullptr) return;
  const auto u = job->units.find(unit_id);
  if (u != job->units.end()) note_lacking(*job, u->second, message, now);
}

// The unit waits. Neither a worker nor the job's other units do.
void Scheduler::note_lacking(Job& job, UnitState& unit, const std::string& message, Now now) {
  ++failures_[index_of(FailureCause::master)];
  ++job.failures[index_of(FailureCause::master)];
  UnitTrouble& trouble = blame(unit, FailureCause::master, nullptr, message);
  FailureHistory history;
  history.cause = FailureCause::master;
  history.unit_id = unit.row.id;
  history.of_unit = ++trouble.failures[index_of(FailureCause::master)];
  trouble.retry_at = now.seconds + consequence(history, options_.failures).unit_wait;
  event(now, job.row.id, "", "unit-failed",
        fmt::format("{}: unit {}: {}", name(FailureCause::master), unit.row.id, message));
  tell_waiting(job, now);
}

// A worker that fell silent may have been ended by the unit that it rendered, which is the first that it was
// given; those behind it only waited there.
void Scheduler::lost_with_worker(const Lease& lease, Now now) {
  const auto w = workers_.find(lease.row.worker_id);
  Job* job = find(lease.row.job_id);
  if (w == workers_.end() || job == nullptr) return;
  WorkerState& worker = w->second;
  if (now.seconds - worker.last_seen < options_.lease_seconds || worker.silence_told == worker.last_seen)
    return;
  worker.silence_told = worker.last_seen;
  const auto u = job->units.find(lease.row.unit_id);
  if (u == job->units.end()) return;
  UnitState& unit = u->second;
  UnitTrouble& trouble =
      blame(unit, FailureCause::worker, &worker, "it fell silent while it had the unit (has it crashed?)");
  ++trouble.lost;
  FailureHistory history;
  history.unit_id = unit.row.id;
  history.of_unit = trouble.lost - 1 + trouble.failures[index_of(FailureCause::worker)];
  if (history.of_unit > 0) trouble.retry_at = now.seconds + consequence(history, options_.failures).unit_wait;
  end_if_poison(*job, unit, now);
}

bool Scheduler::end_if_poison(Job& job, const UnitState& unit, Now now) {
  const UnitTrouble& trouble = *unit.trouble;
  Evidence evidence;
  evidence.failures = unit.row.failures + 0.5 * trouble.lost;
  evidence.workers = trouble.witnesses.size();
  evidence.able = able_workers(job, true, now).size();
  if (!is_poison(evidence, options_.failures)) return false;
  const std::string lost =
      trouble.lost > 0 ? fmt::format(" and was lost with its worker {} times", trouble.lost) : "";
  fail_job(
      job.row.id,
      fmt::format("unit {} failed {} times{}, on {} worker(s), the last time on {}: {} (see that worker's "
                  "log; `candela resume {}` goes on from what is merged)",
                  unit.row.id, unit.row.failures, lost, evidence.workers, trouble.worker_name, trouble.text,
                  job.row.id),
      now);
  return true;
}

bool Scheduler::end_if_refused(Job& job, Now now) {
  if (job.failures[index_of(FailureCause::scene)] == 0 || job.finishing || has_ended(job.row.state))
    return false;
  const auto refused = [&](const std::set<std::string>& said) {
    if (said.empty()) return false;
    const std::set<std::string> able = able_workers(job, false, now);
    const auto others = static_cast<std::size_t>(
        std::count_if(able.begin(), able.end(), [&](const std::string& w) { return !said.contains(w); }));
    return is_refused(said.size(), others);
  };
  for (const auto& [id, unit] : job.units) {
    if (!unit.trouble || !unit.leases.empty()) continue;
    if (unit.trouble->refused_by.empty()) continue;
    if (!refused(unit.trouble->refused_by) && !refused(job.refused_by)) continue;
    fail_job(job.row.id, unit.trouble->refusal, now);
    return true;
  }
  return false;
}

bool Scheduler::lack_blob(const std::string& job_id, const std::string& sha256, const std::string& text,
                          Now now) {
  Job* job = find(job_id);
  if (job == nullptr || has_ended(job->row.state)) return false;
  if (!job->lacks.emplace(sha256, text).second) return false;
  last_activity_ = now.seconds;
  return true;
}

void Scheduler::blob_arrived(const std::string& sha256, Now now) {
  for (auto& [id, job] : jobs_) {
    if (job.lacks.erase(sha256) == 0) continue;
    event(now, id, "", "blob-restored", fmt::format("the master has blob {} again", sha256));
    for (auto& [unit_id, unit] : job.units)
      if (unit.trouble && unit.trouble->cause == FailureCause::master) unit.trouble.reset();
    job.standings.clear();
    last_activity_ = now.seconds;
  }
}

bool Scheduler::forget_failures(Job& job, Now now) {
  bool any = !job.standings.empty() || !job.refused_by.empty() || !job.stuck.empty();
  job.stuck.clear();
  job.standings.clear();
  job.refused_by.clear();
  job.told_waiting = false;
  for (auto& [id, unit] : job.units) {
    if (!unit.trouble && unit.row.failures == 0) continue;
    any = true;
    unit.trouble.reset();
    unit.row.failures = 0;
    save(unit);
  }
  for (auto& [id, w] : workers_) {
    if (w.set_aside_until <= now.seconds || !w.failed_jobs.contains(job.row.id)) continue;
    any = true;
    w.set_aside_until = 0;
    active_.clear();
    w.consecutive_failures = 0;
    w.failed_jobs.clear();
    event(now, "", id, "set-aside", fmt::format("over: job {} was resumed", job.row.id));
  }
  return any;
}

Result<void> Scheduler::resume_failed(Job& job, Now now) {
  const std::string& id = job.row.id;
  CANDELA_TRY(check_starts(job));
  forget_failures(job, now);
  event(now, id, "", "resumed", fmt::format("it had failed: {}", job.row.message));
  job.row.stop_reason.clear();
  job.row.message.clear();
  reopen(job, now);
  last_activity_ = now.seconds;
  save(job, now);
  return {};
}

double Scheduler::next_try(const Job& job, const UnitState& unit, Now now) const {
  double soonest = std::numeric_limits<double>::infinity();
  for (const auto& [id, w] : workers_) {
    if (!lives(w, now) || w.row.draining || w.row.paused || w.distrusted || !can_run(w, job)) continue;
    const auto standing = job.standings.find(id);
    const double waits = standing == job.standings.end() ? 0 : standing->second.retry_at;
    soonest = std::min(soonest, std::max(waits, w.set_aside_until));
  }
  return std::max(soonest, unit.trouble ? unit.trouble->retry_at : 0);
}

std::optional<Waiting> Scheduler::waiting_of(const Job& job, Now now) const {
  if (job.finishing || has_ended(job.row.state)) return std::nullopt;
  const UnitState* shown = nullptr;
  double soonest = std::numeric_limits<double>::infinity();
  std::uint64_t units = 0;
  for (const auto& [id, unit] : job.units) {
    if (!unit.trouble || !is_worth_telling(*unit.trouble)) continue;
    ++units;
    const double next = unit.leases.empty() ? next_try(job, unit, now) : -1;
    if (shown != nullptr && next >= soonest) continue;
    shown = &unit;
    soonest = next;
  }
  // If no worker is left that could try again, the job's message tells that instead.
  if (shown == nullptr || !std::isfinite(soonest)) return std::nullopt;
  const UnitTrouble& trouble = *shown->trouble;
  Waiting out;
  out.cause = trouble.cause;
  out.units = units;
  std::string when = "tried again now";
  if (soonest > now.seconds) {
    const double unix_seconds = static_cast<double>(now.unix_ms) / 1000 + (soonest - now.seconds);
    out.retry_unix_ms = 1000 * static_cast<std::int64_t>(std::ceil(unix_seconds));
    when = fmt::format("tried again at {:%H:%M:%S}Z",
                       fmt::gmtime(static_cast<std::time_t>(out.retry_unix_ms / 1000)));
  }
  out.text = fmt::format("{}: {}; {} unit(s) wait, {}", place_of(trouble), trouble.text, units, when);
  return out;
}

// Once for a time of trouble: each failure has an event of its own.
void Scheduler::tell_waiting(Job& job, Now now) {
  if (job.told_waiting || leases_of(job.row.id) > 0) return;
  const auto waiting = waiting_of(job, now);
  if (!waiting) return;
  job.told_waiting = true;
  event(now, job.row.id, "", "waiting", waiting->text);
}

}  // namespace candela::master
