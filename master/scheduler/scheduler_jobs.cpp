// Jobs: submission, restart, states, stop rules, and what is told about them.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "common/job/stop_limits.h"
#include "master/scheduler/scheduler.h"
#include "master/scheduler/sizing.h"

namespace candela::master {
namespace {

constexpr double kSavePeriod = 5;       // seconds between saves of a running job's elapsed time
constexpr double kUnleasedSeconds = 1;  // without a lease, before a job that ran is queued again
constexpr double kRateWindow = 15;      // seconds over which samples per second are measured
constexpr std::int32_t kMaxPriority = 1000000;

}  // namespace

const HalfSets* Job::asked() const {
  if (row.repairs_to) return &row.promised;
  if (level) return &*level;
  return film::empty(row.stop_indices) ? nullptr : &row.stop_indices;
}

HalfSets Job::unwanted() const {
  const HalfSets* all = asked();
  if (all == nullptr) return {};
  return {complement((*all)[0], end_of((*all)[0])), complement((*all)[1], end_of((*all)[1]))};
}

std::uint64_t Job::target(std::uint32_t half) const {
  const HalfSets* all = asked();
  return all != nullptr ? end_of((*all)[half]) : limit(half);
}

std::uint64_t Job::limit(std::uint32_t half) const {
  if (row.repairs_to) return end_of(row.promised[half]);
  return row.indices_of(half, row.stop.iterations > 0 ? row.stop.iterations : Limits::max_iterations);
}

JobView Job::view(std::uint64_t active_workers) const {
  const HalfSets* all = asked();
  const std::array<std::uint64_t, 2> targets = {target(0), target(1)};
  // The step after the prefix keeps workers busy while that ends.
  const std::uint64_t most =
      prefix == 0 ? PrefixBorder::kNone : prefix_after(prefix, row.chains.has_value()) * row.per_round();
  const std::array<std::uint64_t, 2> open_to = {std::min(targets[0], most), std::min(targets[1], most)};
  JobView out{merged,         targets,      open_to, all != nullptr || row.stop.iterations > 0,
              active_workers, record_bytes, starts,  states};
  for (std::size_t h = 0; all != nullptr && h < 2; ++h) out.unwanted[h] = targets[h] - (*all)[h].count();
  return out;
}

const Job* Scheduler::job(const std::string& id) const {
  if (const auto it = jobs_.find(id); it != jobs_.end()) return &it->second;
  const auto withdrawn = withdrawn_.find(id);
  return withdrawn == withdrawn_.end() ? nullptr : &withdrawn->second.node.mapped();
}

void Scheduler::save(Job& job, Now now) {
  job.last_saved = now.seconds;
  changes_.emplace_back(PutJob{job.row});
}

void Scheduler::save(const UnitState& unit) {
  if (unit.audit && unit.audit->recheck) return;
  changes_.emplace_back(PutUnit{unit.row});
}

void Scheduler::event(Now now, const std::string& job, const std::string& worker, const std::string& kind,
                      const std::string& message) {
  changes_.emplace_back(AddEvent{EventRow{now.unix_ms, job, worker, kind, message}});
}

std::vector<Change> Scheduler::take_changes() {
  return std::exchange(changes_, {});
}

// A job that comes (back) starts level with the least served of its rivals: it neither waits for what it
// missed nor catches up on it.
void Scheduler::start_fairly(Job& job) {
  double least = std::numeric_limits<double>::infinity();
  for (const auto& [id, other] : jobs_) {
    if (&other == &job || !other.open_for_leases() || other.row.priority != job.row.priority) continue;
    // A group that is served already goes on as it was.
    if (job.group != nullptr && other.group == job.group) return;
    least = std::min(least, other.served());
  }
  if (std::isfinite(least)) job.served() = std::max(job.served(), least);
}

void Scheduler::submit(JobRow row, Now now) {
  const std::string id = row.id;
  Job& job = jobs_[id];
  job.row = std::move(row);
  job.source = make_source(job.row);
  job.last_tick = job.unleased_since = now.seconds;
  join_group(job);
  wait_for(job);
  start_fairly(job);
  event(now, id, "", "submitted", job.row.name);
  save(job, now);
  last_activity_ = now.seconds;
}

Result<void> Scheduler::pause(const std::string& id, Now now) {
  Job& job = *find(id);
  if (job.row.state == JobState::paused) return {};
  if (has_ended(job.row.state))
    return refused_error(fmt::format("job {} has ended ({})", id, name(job.row.state))).with_field("job_id");
  if (job.finishing)
    return refused_error(
               fmt::format("job {} has rendered all it was asked for and writes its last checkpoint{}", id,
                           job.note.empty() ? "" : ": " + job.note))
        .with_field("job_id")
        .with_mend("extend it if it is to render more");
  charge(job, now);
  job.row.state = JobState::paused;
  event(now, id, "", "paused", "");
  save(job, now);
  return {};
}

Result<void> Scheduler::set_priority(const std::string& id, std::int32_t priority, Now now) {
  Job& job = *find(id);
  if (has_ended(job.row.state))
    return refused_error(fmt::format("job {} has ended ({})", id, name(job.row.state))).with_field("job_id");
  if (priority < -kMaxPriority || priority > kMaxPriority)
    return input_error(fmt::format("must be -{} to {}", kMaxPriority, kMaxPriority)).with_field("priority");
  if (job.row.priority == priority) return {};
  event(now, id, "", "priority", fmt::format("from {} to {}", job.row.priority, priority));
  job.row.priority = priority;
  start_fairly(job);
  save(job, now);
  return {};
}

Result<void> Scheduler::resume(const std::string& id, Now now) {
  Job& job = *find(id);
  for (const std::string& on : job.row.depends)
    if (auto good = check_dependency(on); !good.ok())
      return refused_error(fmt::format("job {} depends on what is not done: {}", id, good.error().message))
          .with_field("job_id")
          .with_mend("resume that first");
  if (job.row.state == JobState::failed) return resume_failed(job, now);
  if (has_ended(job.row.state))
    return refused_error(fmt::format("job {} has ended ({})", id, name(job.row.state)))
        .with_field("job_id")
        .with_mend("extend it");
  const bool again = forget_failures(job, now);
  if (job.row.state != JobState::paused) {
    if (again) event(now, id, "", "resumed", "what failed is tried again now");
    return {};
  }
  charge(job, now);
  job.row.state = job.leases > 0 ? JobState::running : JobState::queued;
  start_fairly(job);
  event(now, id, "", "resumed", "");
  save(job, now);
  last_activity_ = now.seconds;
  return {};
}

// Ends a job in a state that is final unless it is extended.
void Scheduler::end(Job& job, JobState state, Now now) {
  drop_all_leases(job, now);
  clear_units(job);
  changes_.emplace_back(DropUnmergedUnits{job.row.id});
  job.finishing = job.admitted = job.doubts_due = false;
  job.level.reset();
  job.row.audit.anew.clear();
  if (!distrusted_.empty()) jobs_to_taint_.insert(job.row.id);
  job.memory_wait.clear();
  admission_due_ = true;
  job.row.repairs_to.reset();
  rebuild_reserved(job);
  job.row.state = state;
  job.row.finished_unix_ms = now.unix_ms;
  tell_dependents(job);
  save(job, now);
  last_activity_ = now.seconds;
}

Result<void> Scheduler::cancel(const std::string& id, Now now) {
  Job& job = *find(id);
  if (job.row.state == JobState::cancelled) return {};
  if (has_ended(job.row.state))
    return refused_error(fmt::format("job {} has ended ({})", id, name(job.row.state))).with_field("job_id");
  // A repair that is given up leaves the job as it was before, what is still lost included.
  event(now, id, "", job.row.repairs_to ? "repair-cancelled" : "cancelled", "");
  end(job, job.row.repairs_to.value_or(JobState::cancelled), now);
  return {};
}

void Scheduler::fail_job(const std::string& id, const std::string& message, Now now) {
  Job* job = find(id);
  if (job == nullptr || has_ended(job->row.state)) return;
  job->row.message = message;
  event(now, id, "", "failed", message);
  end(*job, JobState::failed, now);
}

void Scheduler::stop(Job& job, const std::string& reason, Now now) {
  drop_all_leases(job, now);
  clear_units(job);
  changes_.emplace_back(DropUnmergedUnits{job.row.id});
  job.finishing = true;
  job.level.reset();
  job.row.stop_reason = reason;
  event(now, job.row.id, "", "stopping", reason);
  save(job, now);
}

void Scheduler::finish(const std::string& id, Now now) {
  Job* job = find(id);
  if (job == nullptr || !job->finishing || job->doubtful()) return;
  if (job->row.repairs_to) {
    job->note.clear();
    event(now, id, "", "repaired", "all that was lost is rendered again");
    end(*job, *job->row.repairs_to, now);
    return;
  }
  job->row.message.clear();
  if (job->row.stop_reason == "black")
    job->row.message = fmt::format(
        "the image is black: none of {} bootstrap samples found light, nor did {} segments; if the scene has "
        "any, submit it again with more bootstrap samples, another seed, or as bdpt",
        job->row.bootstrap.samples, job->row.iterations);
  job->note.clear();
  event(now, id, "", "done", job->row.stop_reason);
  end(*job, JobState::done, now);
}

void Scheduler::check_stop(Job& job, Now now) {
  if (job.finishing || has_ended(job.row.state) || job.row.iterations == 0) return;
  // A job that lost some of what it had ends no earlier than it has all of that again.
  if (!covers(job.merged, job.row.promised) || job.doubtful()) return;
  if (job.prefix_has_promised()) job.row.promised = {};
  if (job.row.repairs_to) return stop(job, job.row.stop_reason, now);
  const std::string reason = stop_due(job);
  if (!reason.empty() && !(reason == "time" && levels_halves(job, now))) stop(job, reason, now);
}

std::string Scheduler::stop_due(const Job& job) {
  const StopRule& rule = job.row.stop;
  if (job.row.iterations == 0) return {};
  if (!film::empty(job.row.stop_indices) && covers(job.merged, job.row.stop_indices)) return "indices";
  if (rule.iterations > 0 && job.prefixes_done() && contains(job.merged[0], 0, job.limit(0)) &&
      contains(job.merged[1], 0, job.limit(1)))
    return "iterations";
  if (rule.time_seconds > 0 && job.row.elapsed_seconds >= rule.time_seconds) return "time";
  return {};
}

void Scheduler::relmse_estimated(const std::string& id, double relmse, double upper) {
  Job* job = find(id);
  if (job == nullptr) return;
  job->row.relmse = relmse;
  job->row.relmse_upper = upper;
}

Result<void> Scheduler::extend(const std::string& id, std::uint64_t iterations, double seconds, double relmse,
                               Now now) {
  Job& job = *find(id);
  if (job.row.state == JobState::failed)
    return refused_error(fmt::format("job {} has failed", id))
        .with_field("job_id")
        .with_mend("let it go on with: candela resume " + id);
  if (job.row.stop_reason == "black")
    return refused_error(fmt::format("job {} found no light to go on with", id))
        .with_field("job_id")
        .with_mend("submit it again with more bootstrap samples");
  if (!film::empty(job.row.stop_indices))
    return refused_error(fmt::format("job {} was asked for exact indices, and has no more", id))
        .with_field("job_id")
        .with_mend("submit the scene without --indices");
  const auto bad = [](double v, double most) { return !(v >= 0 && v <= most); };
  const double time_before = std::max(job.row.stop.time_seconds, job.row.elapsed_seconds);
  if (bad(seconds, std::max(kMaxStopSeconds - time_before, 0.0)))
    return input_error(fmt::format("must be seconds, 0 or more, with which the job has at most {} in all",
                                   kMaxStopSeconds))
        .with_field("add_time_seconds");
  if (bad(relmse, kMaxStopRelmse))
    return input_error(fmt::format("must be 0 to {}", kMaxStopRelmse)).with_field("relmse");
  if (iterations == 0 && seconds == 0 && relmse == 0)
    return input_error("nothing to add")
        .with_field("add_iterations")
        .with_mend("give iterations, time or relmse");
  StopRule& rule = job.row.stop;
  const HalfSets had = united(job.merged, job.row.promised);
  const std::uint64_t base = rule.iterations > 0 ? rule.iterations : job.row.iterations_of(count(had));
  if (iterations > Limits::max_iterations - std::min(base, Limits::max_iterations))
    return input_error(fmt::format("more than {} iterations in all", Limits::max_iterations))
        .with_field("add_iterations");
  const bool again = has_ended(job.row.state) || job.finishing || job.row.repairs_to;
  if (again) CANDELA_TRY(check_starts(job));
  if (again) {
    job.row.repairs_to.reset();
    // A limit that is met and not moved would end the job at once; it has done its part.
    if (iterations == 0 && contains(had[0], 0, job.target(0)) && contains(had[1], 0, job.target(1)))
      rule.iterations = 0;
    if (seconds == 0 && job.row.elapsed_seconds >= rule.time_seconds) rule.time_seconds = 0;
    if (relmse == 0 && job.row.stop_reason == "relmse") rule.relmse = 0;
  }
  if (iterations > 0) rule.iterations = base + iterations;
  if (seconds > 0)
    rule.time_seconds =
        std::max(rule.time_seconds, again ? job.row.elapsed_seconds : rule.time_seconds) + seconds;
  if (relmse > 0 && relmse != rule.relmse) ++job.prefix_version;  // the prefix is looked at by this rule
  if (relmse > 0) rule.relmse = relmse;
  if (job.level) {
    job.level.reset();
    rebuild_reserved(job);
  }
  if (again) {
    job.row.stop_reason.clear();
    job.row.message.clear();
    reopen(job, now);
    last_activity_ = now.seconds;
  } else if ((job.prefix > 0) != looks_at_prefixes(job)) {
    place_prefix(job, true);
    ask_for_memory(job, job.record_bytes);
  }
  event(now, id, "", "extended",
        fmt::format("to {} iterations, {} s, relmse {} (0: no limit)", rule.iterations, rule.time_seconds,
                    rule.relmse));
  save(job, now);
  return {};
}

void Scheduler::checkpointed(const std::string& id, std::uint64_t generation, std::uint64_t iterations,
                             Now now) {
  Job* job = find(id);
  if (job == nullptr) return;
  job->row.checkpoint_generation = generation;
  job->row.checkpoint_iterations = iterations;
  save(*job, now);
}

void Scheduler::set_note(const std::string& id, const std::string& note) {
  if (Job* job = find(id)) job->note = note;
}

void Scheduler::tick(Now now) {
  expire(now);
  admit_if_due(now);
  look_at_dependencies(now);
  for (auto& [id, job] : jobs_) {
    charge(job, now);
    if ((job.row.state == JobState::running || (job.level && job.row.state == JobState::queued)) &&
        !job.finishing) {
      check_stop(job, now);
      if (now.seconds - job.last_saved > kSavePeriod) save(job, now);
    }
    end_if_refused(job, now);
    if (job.row.state == JobState::running && !job.finishing && job.leases == 0 &&
        now.seconds - job.unleased_since > kUnleasedSeconds) {
      job.row.state = JobState::queued;
      event(now, id, "", "queued", "no worker has a unit of it");
      save(job, now);
    }
  }
  // Looking at a thousand workers takes longer than all else here.
  constexpr double kPeriodOfMany = 1;
  if (workers_.size() >= kManyWorkers && now.seconds >= workers_ticked_ &&
      now.seconds - workers_ticked_ < kPeriodOfMany)
    return;
  workers_ticked_ = now.seconds;
  give_up_stuck(now);
  tell_losses(now);
  ask_cuts(now);
  tick_audits(now);
  for (auto it = workers_.begin(); it != workers_.end();) {
    WorkerState& w = it->second;
    if (w.set_aside_until > 0 && w.set_aside_until <= now.seconds) {
      // On probation: one more failure sets it aside again, for longer.
      w.set_aside_until = 0;
      active_.clear();
      w.consecutive_failures = std::min(w.consecutive_failures, options_.failures.max_worker_failures - 1);
      w.failed_jobs.clear();
      event(now, "", w.row.id, "set-aside", "over; it gets leases again");
    }
    const bool told_of = w.row.units_merged > 0 || w.row.paused || w.row.units_failed > 0 || w.row.draining;
    const double forgotten_after = told_of ? options_.forget_worker_seconds
                                           : std::max(options_.forget_idle_worker_seconds, lost_after());
    if (w.leases.empty() && now.seconds - w.last_seen > forgotten_after) {
      changes_.emplace_back(DropWorker{w.row.id});
      active_.clear();
      it = workers_.erase(it);
    } else {
      ++it;
    }
  }
}

std::size_t Scheduler::leases_of(const std::string& job_id) const {
  const auto job = jobs_.find(job_id);
  return job == jobs_.end() ? 0 : static_cast<std::size_t>(job->second.leases);
}

void Scheduler::note_memory(const std::string& worker_id, std::uint64_t resident_bytes) {
  const auto found = workers_.find(worker_id);
  if (found != workers_.end()) found->second.resident_bytes = resident_bytes;
}

std::uint64_t Scheduler::worker_memory_of(const std::string& job_id) const {
  std::uint64_t most = 0;
  if (leases_of(job_id) == 0) return most;
  for (const auto& [token, lease] : leases_) {
    if (lease.row.job_id != job_id) continue;
    const auto worker = workers_.find(lease.row.worker_id);
    if (worker != workers_.end()) most = std::max(most, worker->second.resident_bytes);
  }
  return most;
}

double Scheduler::samples_per_second(const Job& job, Now now) const {
  if (job.row.state != JobState::running || job.recent.empty()) return 0;
  const Progress& first = job.recent.front();
  const Progress& last = job.recent.back();
  if (now.seconds - last.seconds > kRateWindow) return 0;
  if (last.seconds <= first.seconds)
    return job.row.elapsed_seconds > 0
               ? static_cast<double>(job.row.sample_counts.eye_samples) / job.row.elapsed_seconds
               : 0;
  return static_cast<double>(last.samples - first.samples) / (last.seconds - first.seconds);
}

double Scheduler::indices_per_second(const Job& job, Now now) const {
  if (job.row.state != JobState::running || job.recent.empty()) return 0;
  const Progress& first = job.recent.front();
  const Progress& last = job.recent.back();
  if (now.seconds - last.seconds > kRateWindow) return 0;
  if (last.seconds <= first.seconds)
    return job.row.elapsed_seconds > 0 ? static_cast<double>(job.row.iterations) / job.row.elapsed_seconds
                                       : 0;
  return static_cast<double>(last.indices - first.indices) / (last.seconds - first.seconds);
}

double Scheduler::eta_seconds(const Job& job, Now now) const {
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  if (job.row.state != JobState::running || job.finishing) return kUnknown;
  double eta = std::numeric_limits<double>::infinity();
  const auto per_iteration = static_cast<double>(job.row.indices_per_iteration());
  const double rate = indices_per_second(job, now) / per_iteration;  // iterations
  const double done = static_cast<double>(job.row.iterations) / per_iteration;
  if (rate > 0 && job.row.stop.iterations > 0)
    eta = std::min(eta, std::max(static_cast<double>(job.row.stop.iterations) - done, 0.0) / rate);
  if (rate > 0 && !film::empty(job.row.stop_indices))
    eta = std::min(
        eta, static_cast<double>(count(without(job.row.stop_indices, job.merged))) / (rate * per_iteration));
  if (rate > 0 && job.row.stop.relmse > 0 && job.row.relmse_upper > 0)  // variance goes as 1/n
    eta = std::min(eta, std::max(done * (job.row.relmse_upper / job.row.stop.relmse - 1), 0.0) / rate);
  if (job.row.stop.time_seconds > 0)
    eta = std::min(eta, std::max(job.row.stop.time_seconds - job.row.elapsed_seconds, 0.0));
  return std::isfinite(eta) ? eta : kUnknown;
}

std::string Scheduler::message_of(const Job& job, Now now) const {
  if (has_ended(job.row.state)) {
    std::vector<std::string> texts;
    if (count(job.lost()) > 0)
      texts.push_back(lost_text(job) + fmt::format("; `candela repair {}` renders them again", job.row.id));
    for (const Taint& taint : job.row.audit.taints) texts.push_back(taint_text(taint));
    if (!job.row.message.empty()) texts.push_back(job.row.message);
    if (!texts.empty()) return fmt::format("{}", fmt::join(texts, "; "));
    return job.note.empty() ? chain_message(job.row) : job.note;
  }
  if (!job.note.empty()) return job.note;
  if (job.finishing) return "writing the final checkpoint";
  if (!job.row.audit.anew.empty()) return "begins anew: " + job.row.audit.anew;
  if (job.row.state == JobState::paused) return job.row.message;
  if (std::string text = dependency_text(job); !text.empty()) return text;
  if (!job.memory_wait.empty()) return job.memory_wait;
  if (!job.lacks.empty()) return job.lacks.begin()->second;
  if (const auto waiting = waiting_of(job, now)) return waiting->text;
  if (std::string text = dispute_text(job); !text.empty()) return text;
  std::uint64_t able = 0, live = 0, aside = 0;
  for (const auto& [id, w] : workers_) {
    if (!lives(w, now)) continue;
    ++live;
    if (w.set_aside_until > now.seconds || w.distrusted) ++aside;
    if (usable(w, now) && can_run(w, job)) ++able;
  }
  if (able == 0 && live == 0) return "no worker is connected";
  if (able == 0 && aside == live)
    return fmt::format("all {} worker(s) are set aside after failures{}: see `candela workers`", live,
                       distrusted_.empty() ? "" : ", or distrusted");
  if (able == 0)
    return fmt::format(
        "none of the {} worker(s) connected can run instruction set {}, or they are draining or paused", live,
        job.row.settings.isa);
  if (job.level) return level_text(job);
  if (job.row.stop.time_seconds > 0 && job.row.elapsed_seconds >= job.row.stop.time_seconds)
    return "the time is up; waiting for a first iteration";
  return job.row.message.empty() ? chain_message(job.row) : job.row.message;
}

}  // namespace candela::master
