// The cycle of a unit: lease, heartbeat, delivery, expiry.
#include "master/scheduler/scheduler.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <tuple>

namespace candela::master {
namespace {

constexpr std::uint32_t kFullRetryMs = 1000;

}  // namespace

Scheduler::Scheduler(const SchedulerOptions& options, std::uint64_t epoch, std::uint64_t next_unit_id)
    : options_(options), next_token_((epoch << 32) + 1), next_unit_id_(next_unit_id) {}

Job* Scheduler::find(const std::string& id) {
  const auto it = jobs_.find(id);
  return it == jobs_.end() ? nullptr : &it->second;
}

double Scheduler::seconds_per_iteration(const Job& job, const WorkerState& worker) const {
  const auto it = job.worker_seconds_per_iteration.find(worker.row.id);
  if (it != job.worker_seconds_per_iteration.end()) return it->second;
  return job.thread_seconds / std::max(worker.row.threads, 1U);
}

std::uint64_t Scheduler::active_workers(const Job& job, Now now) {
  // Each lease asks for it, and looking at a thousand workers takes as long as the rest of a lease.
  constexpr double kCountSeconds = 0.25;
  ActiveCount& count = active_[job.row.settings.isa];
  if (workers_.size() >= kManyWorkers && count.workers > 0 && now.seconds >= count.counted &&
      now.seconds - count.counted < kCountSeconds)
    return count.workers;
  count = {0, now.seconds};
  for (const auto& [id, w] : workers_) count.workers += usable(w, now) && can_run(w, job) ? 1 : 0;
  return count.workers;
}

namespace {

// The order of jobs that are served alike: of submission; frames of a group stand together, in their order.
auto place_in_line(const Job& job) {
  const bool grouped = job.group != nullptr;
  return std::tuple(grouped ? job.group->submitted_unix_ms : job.row.submitted_unix_ms,
                    std::string_view(grouped ? job.row.frame->group_id : job.row.id),
                    grouped ? job.row.frame->frame : 0, std::string_view(job.row.id));
}

}  // namespace

// Higher priority first, then the least served; within half a unit of the least served, those whose scene is
// warm.
std::vector<Job*> Scheduler::candidates(const WorkerState& worker, const std::vector<std::string>& warm,
                                        Now now) {
  std::vector<Job*> out;
  for (auto& [id, j] : jobs_)
    if (j.open_for_leases() && can_run(worker, j)) {
      const auto standing = j.standings.find(worker.row.id);
      if (standing == j.standings.end() || standing->second.retry_at <= now.seconds) out.push_back(&j);
    }
  std::sort(out.begin(), out.end(), [](const Job* a, const Job* b) {
    if (a->row.priority != b->row.priority) return a->row.priority > b->row.priority;
    if (a->served() != b->served()) return a->served() < b->served();
    return place_in_line(*a) < place_in_line(*b);
  });
  if (warm.empty()) return out;
  for (auto first = out.begin(); first != out.end();) {
    const double limit = (*first)->served() + 0.5 * options_.unit_seconds / (*first)->row.share;
    const auto last = std::find_if(first, out.end(), [&](const Job* j) {
      return j->row.priority != (*first)->row.priority || j->served() > limit;
    });
    std::stable_partition(first, last, [&](const Job* j) {
      return std::find(warm.begin(), warm.end(), j->row.bundle_sha256) != warm.end();
    });
    first = last;
  }
  return out;
}

Lease& Scheduler::grant(Job& job, UnitState& unit, WorkerState& worker, bool speculative, Now now) {
  Lease lease;
  lease.row.token = next_token_++;
  lease.row.unit_id = unit.row.id;
  lease.row.job_id = job.row.id;
  lease.row.worker_id = worker.row.id;
  lease.row.speculative = speculative;
  const Unit& u = unit.row.unit;
  lease.row.expected_seconds = expected_seconds(job, worker, u);
  lease.granted = now.seconds;
  lease.expires = now.seconds + options_.lease_seconds;
  lease.due_seconds = lease.row.expected_seconds;
  for (const std::uint64_t other : worker.leases) lease.due_seconds += leases_.at(other).row.expected_seconds;
  lease.stepped = now.seconds;
  job.served() +=
      std::max(lease.row.expected_seconds, job.source->cost().min_charged_seconds) / job.row.share;
  unit.leases.push_back(lease.row.token);
  unit.row.state = UnitRow::State::leased;
  if (speculative) unit.speculated = true;
  if (job.row.state == JobState::queued) {
    charge(job, now);
    job.row.state = JobState::running;
    event(now, job.row.id, worker.row.id, "running",
          job.row.named_state || job.row.chains ? "units are leased again" : "the first unit is leased");
    save(job, now);
  }
  ++job.leases;
  worker.leases.insert(lease.row.token);
  save(unit);
  changes_.emplace_back(PutLease{lease.row});
  if (speculative)
    event(now, job.row.id, worker.row.id, "speculation",
          fmt::format("unit {} runs a second time", unit.row.id));
  last_activity_ = now.seconds;
  Lease& granted = leases_.emplace(lease.row.token, lease).first->second;
  if (worker.leases.size() == 1) set_under_way(worker, true, now);
  return granted;
}

bool Scheduler::gather_input(Job& job, UnitState& unit, const FilmInputs* films, AcquireResult& out,
                             Now now) {
  // A pilot starts from nothing, also one that is compared while its job is in a later stage.
  if (unit.row.unit.kind == Unit::Kind::pilot) {
    out.input = {};
    return true;
  }
  FilmInputs::Records records;
  if (films != nullptr && job.source->needs_film()) {
    FilmInputs::Answer answer = films->chain_records(job.row.id, unit.row.unit);
    if (answer.state == FilmInputs::State::unread) out.unread.push_back(job.row.id);
    if (answer.state == FilmInputs::State::lost) {
      out.lacking.push_back(job.row.id);
      note_lacking(job, unit, "the job's film does not hold the segments that this unit's chains go on from",
                   now);
    }
    if (answer.state != FilmInputs::State::whole) return false;
    records = std::move(answer.records);
  }
  out.input = job.source->input(job.view(), unit.row.unit, std::move(records));
  return true;
}

bool Scheduler::lease_unit(Job& job, WorkerState& worker, bool prefetch, const FilmInputs* films,
                           AcquireResult& out, Now now) {
  constexpr int kAttempts = 8;  // of one job, so that no other job waits for it
  for (int i = 0; i < kAttempts; ++i) {
    UnitState* unit = pick(job, worker, prefetch, now);
    if (unit == nullptr) return false;
    if (gather_input(job, *unit, films, out, now)) {
      out.lease = grant(job, *unit, worker, false, now);
      return true;
    }
    if (!unit->waits(now.seconds)) return false;  // it would be picked again
  }
  return false;
}

AcquireResult Scheduler::acquire(const std::string& worker_id, const std::vector<std::string>& warm,
                                 LeaseWish wish, Now now, const FilmInputs* films) {
  const bool prefetch = wish.prefetch;
  expire(now);
  admit_if_due(now);
  AcquireResult out;
  WorkerState& worker = workers_.at(worker_id);
  worker.last_asked = now.seconds;
  out.drain = worker.row.draining;
  // Idle farms are asked more rarely the longer they are idle, but a small farm can always afford four calls
  // a second.
  const double idle_ms = (now.seconds - last_activity_) * 100;
  const double cap = workers_.size() <= 16 ? 250 : 2000;
  out.retry_ms = static_cast<std::uint32_t>(std::clamp(idle_ms, 50.0, cap));
  if (out.drain) return out;
  // An idle worker has ended whatever was taken from it; a busy one may not have heard of it.
  if (!prefetch) worker.leftovers.clear();
  if (!worker.leftovers.empty()) return out;
  if (worker.row.paused) {
    out.retry_ms = 1000;
    return out;
  }
  if (worker.set_aside_until > now.seconds) {
    out.retry_ms = 2000;
    return out;
  }
  if (worker.leases.size() >= options_.max_leases_per_worker) return out;
  if (worker.distrusted) {
    out.retry_ms = 2000;
    return out;
  }
  std::vector<Job*> order = candidates(worker, warm, now);
  if (wish.full) {
    const std::int64_t highest = highest_priority(worker);
    std::erase_if(order, [&](const Job* job) { return job->row.priority <= highest; });
    out.retry_ms = std::max(out.retry_ms, kFullRetryMs);
  }
  for (Job* job : order)
    if (!job->held.empty() && lease_held(*job, worker, films, out, now)) return out;
  for (Job* job : order) {
    if (lease_unit(*job, worker, prefetch, films, out, now)) return out;
    // Its last units wait for a worker that is free. This one is soon, unless it takes another job's unit
    // first, and another, for as long as that job lasts.
    const bool short_of_input = std::count(out.unread.begin(), out.unread.end(), job->row.id) > 0 ||
                                std::count(out.lacking.begin(), out.lacking.end(), job->row.id) > 0;
    if (prefetch && !short_of_input && has_work(*job, worker, now)) return out;
  }
  if (!prefetch) {
    for (Job* job : order) {
      UnitState* unit = straggler(*job, worker, now);
      if (unit != nullptr && gather_input(*job, *unit, films, out, now)) {
        out.lease = grant(*job, *unit, worker, true, now);
        return out;
      }
    }
  }
  for (const Job* job : order)  // what runs or is decided ends soon and opens the job
    if (job->source->due_decision(job->view())) {
      out.retry_ms = 50;
    } else if (!job->source->makes_film() &&
               std::any_of(job->units.begin(), job->units.end(),
                           [](const auto& unit) { return !unit.second.leases.empty(); }))
      out.retry_ms = 50;
  return out;
}

HeartbeatResult Scheduler::heartbeat(const std::string& worker_id, const std::vector<UnitReport>& units,
                                     Now now) {
  expire(now);
  HeartbeatResult out;
  WorkerState& worker = workers_.at(worker_id);
  out.drain = worker.row.draining;
  std::set<std::uint64_t> named;
  for (const UnitReport& unit : units) {
    named.insert(unit.token);
    const auto it = leases_.find(unit.token);
    if (it == leases_.end() || it->second.row.worker_id != worker_id) {
      out.revoked.push_back(unit.token);
      if (const auto left = worker.leftovers.find(unit.token); left != worker.leftovers.end()) {
        left->second.named = true;
        left->second.phase = unit.phase;
      }
      continue;
    }
    it->second.listed = true;
    it->second.expires = now.seconds + options_.lease_seconds;
    note_steps(it->second, unit, now);
    if (it->second.cut) out.cut.push_back(unit.token);
  }
  // A worker names all that it holds. What it has not named, and has had time to hear of, it does not have:
  // its answer was lost, or the lease outlived a restart that its unit did not. The token keeps a late
  // delivery out.
  const double settled = std::min(5.0, options_.lease_seconds / 3);
  std::vector<std::uint64_t> forgotten;
  for (const std::uint64_t token : worker.leases) {
    const auto it = leases_.find(token);
    if (it != leases_.end() && now.seconds - it->second.granted > settled && !named.contains(token))
      forgotten.push_back(token);
  }
  std::erase_if(worker.leftovers, [&](const auto& entry) {
    const auto& [token, left] = entry;
    return !named.contains(token) && (left.named || now.seconds - left.since > settled);
  });
  for (const std::uint64_t token : forgotten) {
    ++expired_count_;
    drop_lease(token, now, true);
  }
  return out;
}

void Scheduler::touch_lease(std::uint64_t token, Now now) {
  const auto it = leases_.find(token);
  if (it != leases_.end()) it->second.expires = now.seconds + options_.lease_seconds;
}

// Takes a lease away; its unit is open again if nobody else has it.
void Scheduler::drop_lease(std::uint64_t token, Now now, bool refund) {
  const auto it = leases_.find(token);
  if (it == leases_.end()) return;
  const Lease lease = it->second;
  const auto w = workers_.find(lease.row.worker_id);
  const bool oldest = w != workers_.end() && *w->second.leases.begin() == token;
  if (oldest) set_under_way(w->second, false, now);
  leases_.erase(it);
  changes_.emplace_back(DropLease{token});
  if (w != workers_.end()) w->second.leases.erase(token);
  if (oldest) set_under_way(w->second, true, now);
  Job* job = find(lease.row.job_id);
  if (job == nullptr) return;
  if (--job->leases == 0) job->unleased_since = now.seconds;
  if (refund) {  // what was charged beyond the time it was held
    const double unused = std::max(lease.row.expected_seconds - (now.seconds - lease.granted), 0.0);
    job->served() -= unused / job->row.share;
  }
  const auto u = job->units.find(lease.row.unit_id);
  if (u == job->units.end()) return;
  std::erase(u->second.leases, token);
  u->second.speculated = u->second.leases.size() > 1;
  if (u->second.leases.empty()) {
    u->second.row.state = UnitRow::State::open;
    job->maybe_open.insert(u->first);
    save(u->second);
  }
}

void Scheduler::take_away(std::uint64_t token, Now now, bool refund) {
  const auto it = leases_.find(token);
  if (it == leases_.end()) return;
  const LeaseRow& row = it->second.row;
  if (const auto w = workers_.find(row.worker_id); w != workers_.end())
    w->second.leftovers[token] = {row.job_id, now.seconds, it->second.listed, it->second.phase};
  drop_lease(token, now, refund);
}

void Scheduler::charge(Job& job, Now now) {
  // A repair's time was spent before, by the samples that were lost.
  if (job.under_way > 0 && job.row.state == JobState::running && !job.finishing && !job.row.repairs_to)
    job.row.elapsed_seconds += std::max(now.seconds - job.last_tick, 0.0);
  job.last_tick = now.seconds;
}

void Scheduler::set_under_way(const WorkerState& worker, bool begins, Now now) {
  if (worker.leases.empty()) return;
  Job* job = find(leases_.at(*worker.leases.begin()).row.job_id);
  if (job == nullptr) return;
  charge(*job, now);
  if (begins)
    ++job->under_way;
  else
    --job->under_way;
}

void Scheduler::drop_all_leases(Job& job, Now now) {
  std::vector<std::uint64_t> tokens;
  for (const auto& [token, lease] : leases_)
    if (lease.row.job_id == job.row.id) tokens.push_back(token);
  for (const std::uint64_t token : tokens) take_away(token, now, true);
}

void Scheduler::return_lease(const std::string& worker_id, std::uint64_t token, Now now, bool computing) {
  expire(now);
  const auto it = leases_.find(token);
  if (it == leases_.end() || it->second.row.worker_id != worker_id) return;
  event(now, it->second.row.job_id, worker_id, "returned",
        fmt::format("unit {} was handed back", it->second.row.unit_id));
  if (computing)
    take_away(token, now, true);
  else
    drop_lease(token, now, true);
  last_activity_ = now.seconds;
}

const Job* Scheduler::job_of_lease(const std::string& worker_id, std::uint64_t token) const {
  const auto it = leases_.find(token);
  return it == leases_.end() || it->second.row.worker_id != worker_id ? nullptr : job(it->second.row.job_id);
}

namespace {

// True if the job's sums fit this plan.
bool same_work(const JobRow& row, const WorkPlan& work) {
  const WorkPlan had{row.layers, row.accumulators, row.chains, row.epochs, row.development};
  return pilot_sha256({{}, "", 0, had}) == pilot_sha256({{}, "", 0, work});
}

}  // namespace

bool Scheduler::complete_pilot(const std::string& worker_id, std::uint64_t token, const PilotResult& result,
                               Now now) {
  expire(now);
  const auto it = leases_.find(token);
  if (it == leases_.end() || it->second.row.worker_id != worker_id) return false;
  Job* job = find(it->second.row.job_id);
  if (job == nullptr || job->finishing || has_ended(job->row.state)) return false;
  const auto u = job->units.find(it->second.row.unit_id);
  if (u == job->units.end() || u->second.row.unit.kind != Unit::Kind::pilot) return false;
  WorkerState& worker = workers_.at(worker_id);
  const Unit unit = u->second.row.unit;
  const std::string sha256 = pilot_sha256(result);
  if (u->second.audit) {
    vote(*job, u->second, worker, {worker_id, token, u->first, job->row.id, unit, sha256, sha256, 0}, now);
    return true;
  }
  note_success(*job, worker, now);
  if (job->row.pilot_outdated && !same_work(job->row, result.work)) {
    fail_job(job->row.id, "the new build plans other sums for this job than the old one did; submit it again",
             now);
    return true;
  }
  job->row.audit.pilot_sha256 = sha256;
  job->row.audit.pilot_by = {identity(worker.row)};
  std::set<std::string> others = jury(*job, now);
  others.erase(identity(worker.row));
  job->row.audit.pilot_due = !others.empty() && chosen_for_audit(*job, unit, worker);
  job->row.chains = result.work.chains;
  job->row.pilot_scale_log2 = result.state.film_scale_log2;
  job->row.decided = result.state.decided;
  note_build(*job, now);
  // The film has its scale.
  if (!std::exchange(job->row.pilot_outdated, false) && !result.work.chains)
    job->row.named_state = NamedState{result.state.film_scale_log2, result.state.bootstrap_b};
  job->row.plan = result.plan;
  job->row.layers = result.work.layers;
  job->row.accumulators = result.work.accumulators;
  job->row.epochs = result.work.epochs;
  job->row.development = result.work.development;
  job->source = make_source(job->row);
  place_prefix(*job);
  ask_for_memory(*job, 0);
  job->row.thread_seconds_per_iteration = result.seconds_per_iteration * worker.row.threads;
  job->thread_seconds = job->row.thread_seconds_per_iteration;
  const std::uint64_t unit_id = u->first;
  const std::vector<std::uint64_t> tokens = u->second.leases;  // the winner's and a speculative one
  for (const std::uint64_t t : tokens)
    if (t == token)
      drop_lease(t, now, true);
    else
      take_away(t, now, true);
  job->units.erase(unit_id);
  changes_.emplace_back(DropUnit{unit_id});
  add_pilot_recheck(*job, now);
  if (std::string why; !make_film_source(job->row)->complete(job->row.stop_indices, why)) {
    fail_job(job->row.id, "the indices that it was asked for cannot be rendered without others: " + why, now);
    return true;
  }
  rebuild_reserved(*job);
  std::string text = fmt::format("{:.4g} s per iteration", result.seconds_per_iteration);
  if (result.work.chains)
    text = fmt::format("{} chains, {} bootstrap samples, {:.4g} s per segment of {} mutations",
                       result.work.chains->chains, result.work.chains->bootstrap_samples,
                       result.seconds_per_iteration, result.work.chains->segment_mutations);
  else
    text = fmt::format("film scale 2^{}, {}", job->row.named_state->film_scale_log2, text);
  if (!result.work.layers.empty()) text += fmt::format(", {} layers", result.work.layers.size());
  event(now, job->row.id, worker_id, "pilot", text);
  admit_if_due(now);
  save(*job, now);
  last_activity_ = now.seconds;
  return true;
}

Delivery Scheduler::check_delivery(const std::string& worker_id, std::uint64_t token, std::uint64_t unit_id,
                                   const std::string& job_id, const Unit& unit, Now now) {
  expire(now);
  const Job* job = find(job_id);
  if (job == nullptr) return Delivery::stale;
  const auto known = job->units.find(unit_id);
  const Audit* audit = known != job->units.end() && known->second.audit ? &*known->second.audit : nullptr;
  const bool recheck = audit != nullptr && audit->recheck;  // of what is merged
  const Claim claim = job->source->claim(job->merged, unit);
  if (claim == Claim::foreign) return Delivery::stale;
  if (claim == Claim::merged && !recheck) return Delivery::duplicate;
  if (job->finishing || has_ended(job->row.state)) return Delivery::job_ended;
  const auto it = leases_.find(token);
  if (it == leases_.end() || it->second.row.worker_id != worker_id || it->second.row.unit_id != unit_id ||
      it->second.row.job_id != job_id)
    return Delivery::stale;
  const Unit& leased = job->units.at(unit_id).row.unit;
  // Only the same iterations can be compared.
  const bool can_be_cut = unit.kind == Unit::Kind::iterations || unit.kind == Unit::Kind::segments;
  const bool cut_short = audit == nullptr && can_be_cut && unit.begin < unit.end && unit.end < leased.end;
  if (leased.kind != unit.kind || leased.half != unit.half || leased.begin != unit.begin ||
      (leased.end != unit.end && !cut_short))
    return Delivery::stale;
  return Delivery::ok;
}

void Scheduler::merged(const std::string& worker_id, std::uint64_t token, std::uint64_t unit_id,
                       const std::string& job_id, const Unit& unit, const film::SampleCounts& sample_counts,
                       double render_seconds, double overhead_seconds, Now now, std::size_t record_bytes,
                       double merge_seconds, const std::string& sha256) {
  Job* job = find(job_id);
  if (job == nullptr || token < job->first_token || is_dropped(*job, unit)) return;
  if (!job->merged[unit.half].insert(unit.begin, unit.end)) return;
  UnitRow row;
  row.id = unit_id;
  row.job_id = job_id;
  row.unit = unit;
  if (const auto u = job->units.find(unit_id); u != job->units.end()) {
    row.failures = u->second.row.failures;
    if (u->second.audit) {
      const Audit& audit = *u->second.audit;
      for (const AuditAnswer& answer : audit.answers)
        if (answer.sha256 == sha256) row.by = audit.workers_with(audit.key(answer));
      note_compared(audit);
    }
    if (const auto lease = leases_.find(token); lease != leases_.end())  // charge what it cost
      job->served() += (render_seconds - lease->second.row.expected_seconds) / job->row.share;
    const std::vector<std::uint64_t> tokens =
        u->second.leases;  // another worker's too: it hears with its heartbeat
    for (const std::uint64_t t : tokens)
      if (t == token)
        drop_lease(t, now, false);
      else
        take_away(t, now, true);
    // A unit that was cut short: its last indices are cut anew.
    const std::uint64_t leased_end = u->second.row.unit.end;
    job->units.erase(unit_id);
    job->held.erase(unit_id);
    if (unit.end < leased_end) job->source->put_back({unit.kind, unit.half, unit.end, leased_end});
  } else {
    // Its indices may have been cut again while it was on its way. Units that have some of them go, and their
    // others are cut anew; the workers hear with their heartbeats.
    for (auto next = job->units.begin(); next != job->units.end();) {
      const auto again = next++;
      const Unit& other = again->second.row.unit;
      if (other.half != unit.half || other.begin >= unit.end || unit.begin >= other.end) continue;
      if (again->second.audit && again->second.audit->recheck) continue;
      const std::vector<std::uint64_t> tokens = again->second.leases;
      for (const std::uint64_t t : tokens) take_away(t, now, true);
      changes_.emplace_back(DropUnit{again->first});
      job->held.erase(again->first);
      job->units.erase(again);
    }
    rebuild_reserved(*job);
  }
  job->record_bytes = std::max(job->record_bytes, record_bytes);
  row.state = UnitRow::State::merged;
  row.worker_id = worker_id;
  row.token = token;
  row.seconds = render_seconds;
  row.sha256 = sha256;
  if (const auto w = workers_.find(worker_id); w != workers_.end()) {
    const std::string who = identity(w->second.row);
    std::erase(row.by, who);
    row.by.insert(row.by.begin(), who);
  }
  // It may have been distrusted while its delta was merged.
  if (distrusts_any(row.by)) doubt_again(*job);
  changes_.emplace_back(PutUnit{row});

  JobRow& j = job->row;
  if (unit.begin >= job->border().end[unit.half]) ++job->units_ahead;
  j.units_merged += 1;
  j.iterations += unit.end - unit.begin;
  j.sample_counts.add(sample_counts);
  j.worker_seconds += render_seconds;
  note_build(*job, now);
  if (const auto w = workers_.find(worker_id); w != workers_.end()) {
    w->second.row.units_merged += 1;
    note_success(*job, w->second, now);
    note_cost(*job, w->second, unit, render_seconds);
  }
  blend(job->overhead_seconds, overhead_seconds);
  blend(job->merge_seconds, merge_seconds);
  job->recent.push_back({now.seconds, j.sample_counts.eye_samples, j.iterations});
  while (job->recent.size() > 2 && now.seconds - job->recent.front().seconds > 15) job->recent.pop_front();
  last_activity_ = now.seconds;
  check_stop(*job, now);
}

void Scheduler::note_cost(Job& job, const WorkerState& worker, const Unit& unit, double render_seconds) {
  const double per_index =
      render_seconds / static_cast<double>(std::max<std::uint64_t>(unit.end - unit.begin, 1));
  const double per_iteration = per_index * job.source->cost().indices_per_iteration;
  if (!(per_iteration > 0)) return;
  blend(job.worker_seconds_per_iteration[worker.row.id], per_iteration);
  blend(job.thread_seconds, per_iteration * worker.row.threads);
  job.row.thread_seconds_per_iteration = job.thread_seconds;
}

void Scheduler::expire(Now now) {
  // Each call of a worker comes here, and a large farm has thousands of leases.
  if (now.seconds <= none_expires_before_) return;
  std::vector<std::uint64_t> late;
  // A lease that is granted or renewed from now on lasts for a period at least.
  none_expires_before_ = now.seconds + options_.lease_seconds;
  for (const auto& [token, lease] : leases_) {
    // A lease no heartbeat has named yet may not have reached its worker; it gets one more period.
    const double end = lease.expires + (lease.listed ? 0 : options_.lease_seconds);
    if (now.seconds > end)
      late.push_back(token);
    else
      none_expires_before_ = std::min(none_expires_before_, end);
  }
  for (const std::uint64_t token : late) {
    const auto it = leases_.find(token);
    if (it == leases_.end()) continue;  // its job was given up for the unit of another of these leases
    const Lease lease = it->second;
    event(now, lease.row.job_id, lease.row.worker_id, "expired",
          fmt::format("the lease of unit {} ran out", lease.row.unit_id));
    ++expired_count_;
    drop_lease(token, now, false);
    lost_with_worker(lease, now);
    last_activity_ = now.seconds;
  }
}

}  // namespace candela::master
