// Workers: registration, liveness, draining.
#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "master/scheduler/scheduler.h"

namespace candela::master {

bool Scheduler::lives(const WorkerState& worker, Now now) const {
  return now.seconds - worker.last_seen <= lost_after();
}

bool Scheduler::takes_part(const WorkerState& worker, Now now) const {
  return lives(worker, now) && !worker.row.draining && !worker.row.paused && !worker.distrusted &&
         (!worker.leases.empty() || now.seconds - worker.last_asked <= lost_after());
}

bool Scheduler::usable(const WorkerState& worker, Now now) const {
  return worker.set_aside_until <= now.seconds && takes_part(worker, now);
}

bool Scheduler::can_run(const WorkerState& worker, const std::string& isa) const {
  const auto& isas = worker.row.isas;
  return std::find(isas.begin(), isas.end(), isa) != isas.end();
}

// Forgets the worker that would be missed least: one that never called after it registered, else one that is
// lost and never merged, else one that never merged, else one that is lost; of several the one not heard of
// for longest. A worker that is forgotten by mistake registers again. False if all have leases, or have
// merged units and are there.
bool Scheduler::make_room_for_worker(Now now) {
  const auto rank = [&](const WorkerState& w) {
    const bool lost = now.seconds - w.last_seen > lost_after();
    const bool merged = w.row.units_merged > 0;
    return !w.called && !merged ? 0 : lost && !merged ? 1 : !merged ? 2 : lost ? 3 : 4;
  };
  auto chosen = workers_.end();
  std::pair<int, double> lowest{4, 0};
  for (auto it = workers_.begin(); it != workers_.end(); ++it) {
    if (!it->second.leases.empty()) continue;
    const std::pair<int, double> key{rank(it->second), it->second.last_seen};
    if (key >= lowest) continue;
    lowest = key;
    chosen = it;
  }
  if (chosen == workers_.end()) return false;
  changes_.emplace_back(DropWorker{chosen->first});
  active_.clear();
  workers_.erase(chosen);
  return true;
}

Result<void> Scheduler::register_worker(WorkerRow row, Now now) {
  if (workers_.size() >= options_.max_workers && !make_room_for_worker(now))
    return resource_error(fmt::format("the farm has its limit of {} workers", options_.max_workers));
  row.last_seen_unix_ms = now.unix_ms;
  event(now, "", row.id, "registered",
        fmt::format("{} on {} with {} threads", row.name, row.host, row.threads));
  row.paused = paused_.contains(identity(row));
  changes_.emplace_back(PutWorker{row});
  active_.clear();
  WorkerState& w = workers_[row.id];
  w.row = std::move(row);
  w.distrusted = distrusted_.contains(identity(w.row));
  w.last_seen = w.last_asked = now.seconds;
  last_activity_ = now.seconds;
  return {};
}

void Scheduler::restore_worker(const WorkerRow& row, Now now) {
  active_.clear();
  WorkerState& w = workers_[row.id];
  w.row = row;
  w.last_seen = w.last_asked = now.seconds;  // it has as long to come back as if we had just heard of it
  w.awaited = true;
  w.distrusted = distrusted_.contains(identity(row));
  w.borne_out = row.units_merged >= kFirstAudits ? kFirstAudits : 0;
  if (row.paused) paused_.insert(identity(row));
}

void Scheduler::restore_lease(const LeaseRow& row, Now now) {
  next_token_ = std::max(next_token_, row.token + 1);
  Job* job = find(row.job_id);
  const auto worker = workers_.find(row.worker_id);
  if (job == nullptr || worker == workers_.end() || job->finishing || has_ended(job->row.state)) {
    changes_.emplace_back(DropLease{row.token});
    return;
  }
  const auto unit = job->units.find(row.unit_id);
  if (unit == job->units.end() || unit->second.leases.size() >= 2 || worker->second.distrusted) {
    changes_.emplace_back(DropLease{row.token});
    return;
  }
  Lease lease;
  lease.row = row;
  lease.granted = now.seconds;
  lease.expires = now.seconds + options_.lease_seconds;
  lease.due_seconds = row.expected_seconds;
  lease.stepped = now.seconds;
  // Rows come in the order of their tokens, so that the first is its worker's oldest.
  ++job->leases;
  leases_.emplace(row.token, lease);
  unit->second.leases.push_back(row.token);
  unit->second.speculated = unit->second.leases.size() > 1;
  unit->second.row.state = UnitRow::State::leased;
  if (!worker->second.leases.empty()) set_under_way(worker->second, false, now);
  worker->second.leases.insert(row.token);
  set_under_way(worker->second, true, now);
}

WorkerState* Scheduler::authenticate(const std::string& id, const std::string& session, Now now) {
  const auto it = workers_.find(id);
  if (it == workers_.end()) return nullptr;
  // Compared in a time that does not tell how much of it was right.
  const std::string& expected = it->second.row.session;
  if (expected.size() != session.size() || session.empty()) return nullptr;
  unsigned difference = 0;
  for (std::size_t i = 0; i < session.size(); ++i)
    difference |= static_cast<unsigned>(static_cast<unsigned char>(session[i]) ^
                                        static_cast<unsigned char>(expected[i]));
  if (difference != 0) return nullptr;
  if (it->second.told_of_loss)
    event(now, "", id, "back",
          fmt::format("{} on {} is heard of again", it->second.row.name, it->second.row.host));
  it->second.told_of_loss = false;
  it->second.last_seen = now.seconds;
  it->second.called = true;
  it->second.awaited = false;
  it->second.row.last_seen_unix_ms = now.unix_ms;
  return &it->second;
}

Result<void> Scheduler::drain(const std::string& worker_id, Now now) {
  const auto it = workers_.find(worker_id);
  if (it == workers_.end())
    return input_error(fmt::format("there is no worker {}", worker_id)).with_field("worker_id");
  if (it->second.row.draining) return {};
  it->second.row.draining = true;
  active_.clear();
  event(now, "", worker_id, "draining", "");
  changes_.emplace_back(PutWorker{it->second.row});
  return {};
}

Result<void> Scheduler::pause_worker(const std::string& worker_id, Now now) {
  const auto it = workers_.find(worker_id);
  if (it == workers_.end())
    return input_error(fmt::format("there is no worker {}", worker_id)).with_field("worker_id");
  WorkerState& worker = it->second;
  if (worker.row.draining)
    return refused_error(fmt::format("worker {} is draining and will leave", worker_id))
        .with_field("worker_id");
  paused_.insert(identity(worker.row));
  for (auto& [id, w] : workers_) {
    if (w.row.paused || identity(w.row) != identity(worker.row)) continue;
    w.row.paused = true;
    cut_leases(w, std::numeric_limits<std::int64_t>::max());
    event(now, "", id, "paused", w.row.name);
    changes_.emplace_back(PutWorker{w.row});
  }
  active_.clear();
  return {};
}

Result<void> Scheduler::resume_worker(const std::string& worker_id, Now now) {
  const auto it = workers_.find(worker_id);
  if (it == workers_.end())
    return input_error(fmt::format("there is no worker {}", worker_id)).with_field("worker_id");
  const std::string same = identity(it->second.row);
  paused_.erase(same);
  for (auto& [id, w] : workers_) {
    if (!w.row.paused || identity(w.row) != same) continue;
    w.row.paused = false;
    event(now, "", id, "resumed", w.row.name);
    changes_.emplace_back(PutWorker{w.row});
  }
  active_.clear();
  last_activity_ = now.seconds;
  return {};
}

void Scheduler::deregister(const std::string& worker_id, Now now) {
  const auto it = workers_.find(worker_id);
  if (it == workers_.end()) return;
  const std::set<std::uint64_t> tokens = it->second.leases;
  for (const std::uint64_t token : tokens) drop_lease(token, now, true);
  event(now, "", worker_id, "left", it->second.row.name);
  changes_.emplace_back(DropWorker{worker_id});
  for (auto& [id, job] : jobs_) job.standings.erase(worker_id);
  active_.clear();
  workers_.erase(worker_id);
  last_activity_ = now.seconds;
}

std::set<std::string> Scheduler::jobs_of(const WorkerState& worker) const {
  std::set<std::string> out;
  for (const std::uint64_t token : worker.leases) out.insert(leases_.at(token).row.job_id);
  return out;
}

std::string Scheduler::worker_state_name(const WorkerState& w, Now now) const {
  if (!lives(w, now)) return "lost";
  if (w.awaited) return "awaited";
  if (w.distrusted) return "distrusted";
  if (!stuck_text(w, now).empty()) return "stuck";
  const bool idle = w.leases.empty() && w.leftovers.empty();
  if (w.row.draining) return idle ? "drained" : "draining";
  if (w.row.paused) return idle ? "paused" : "pausing";
  if (w.set_aside_until > now.seconds) return "set-aside";
  return idle ? "idle" : "busy";
}

}  // namespace candela::master
