// Jobs of epochs: which state is decided next, and what follows.
#include <fmt/format.h>

#include "master/scheduler/scheduler.h"

namespace candela::master {

std::vector<EpochJob> Scheduler::epoch_jobs() const {
  std::vector<EpochJob> out;
  for (const auto& [id, job] : jobs_) {
    if (!job.row.epochs || has_ended(job.row.state) || !job.has_memory() || !job.row.audit.anew.empty())
      continue;
    const bool due = !job.finishing && job.source->due_decision(job.view()).has_value();
    out.push_back({id, job.states.size(), due});
  }
  return out;
}

bool Scheduler::agrees(const StateRow& row, Now now) {
  const Job* job = find(row.job_id);
  if (job == nullptr) return false;
  if (row.epoch >= job->known_states.size() || job->known_states[row.epoch] == row.sha256) return true;
  fail_job(row.job_id,
           fmt::format("the state of epoch {} was decided anew and is {}, not {}: the sums have changed",
                       row.epoch, row.sha256, job->known_states[row.epoch]),
           now);
  return false;
}

void Scheduler::decided(const StateRow& row, Now now) {
  Job* job = find(row.job_id);
  if (job == nullptr || row.epoch != job->states.size() || !agrees(row, now)) return;
  job->states.push_back(row);
  changes_.emplace_back(PutState{row});
  last_activity_ = now.seconds;
  if (row.epoch < job->known_states.size()) return;
  job->known_states.push_back(row.sha256);
  event(now, row.job_id, "", "decided",
        fmt::format("state '{}' of epoch {}: {} bytes, {}", row.name, row.epoch, row.size_bytes, row.sha256));
}

bool Scheduler::lost_state(const std::string& sha256, Now now) {
  bool any = false;
  for (auto& [id, job] : jobs_)
    for (std::size_t e = 0; e < job.states.size(); ++e) {
      if (job.states[e].sha256 != sha256) continue;
      any = true;
      job.states.resize(e);
      event(now, id, "", "state-lost", fmt::format("the state of epoch {} is restored or decided anew", e));
    }
  return any;
}

void Scheduler::restore_states(Job& job, const std::vector<StateRow>& states) {
  for (const StateRow& row : states) {
    if (row.epoch != job.states.size()) break;
    job.states.push_back(row);
    job.known_states.push_back(row.sha256);
  }
}

}  // namespace candela::master
