// Jobs of epochs: which state is decided next, and what follows.
#include <fmt/format.h>

#include "common/stages/epochs.h"
#include "master/scheduler/scheduler.h"

namespace candela::master {

std::vector<DueDecision> Scheduler::due_decisions() const {
  std::vector<DueDecision> out;
  for (const auto& [id, job] : jobs_) {
    if (!job.row.epochs || job.finishing || has_ended(job.row.state)) continue;
    const auto epoch = job.source->due_decision(job.view());
    if (!epoch) continue;
    DueDecision due;
    due.job_id = id;
    due.plan = *job.row.epochs;
    due.epoch = *epoch;
    due.width = job.row.settings.width;
    due.height = job.row.settings.height;
    if (*epoch > 0) due.previous = job.states.at(*epoch - 1);
    const Epochs epochs(due.plan.first, due.plan.growth);
    const std::uint64_t end = epochs.begin_index(epochs_before(*epoch, due.plan.lag));
    if (end > 0)
      for (film::IndexSet& half : due.needed) half.insert(0, end);
    out.push_back(std::move(due));
  }
  return out;
}

void Scheduler::decided(const StateRow& row, Now now) {
  Job* job = find(row.job_id);
  if (job == nullptr || row.epoch != job->states.size()) return;
  if (row.epoch < job->known_states.size() && job->known_states[row.epoch] != row.sha256)
    return fail_job(
        row.job_id,
        fmt::format("the state of epoch {} was decided anew and is {}, not {}: the sums have changed",
                    row.epoch, row.sha256, job->known_states[row.epoch]),
        now);
  if (row.epoch == job->known_states.size()) job->known_states.push_back(row.sha256);
  job->states.push_back(row);
  changes_.emplace_back(PutState{row});
  event(now, row.job_id, "", "decided",
        fmt::format("state '{}' of epoch {}: {} bytes, {}", row.name, row.epoch, row.size_bytes, row.sha256));
  last_activity_ = now.seconds;
}

bool Scheduler::lost_state(const std::string& sha256, Now now) {
  bool any = false;
  for (auto& [id, job] : jobs_)
    for (std::size_t e = 0; e < job.states.size(); ++e) {
      if (job.states[e].sha256 != sha256) continue;
      any = true;
      job.states.resize(e);
      event(now, id, "", "state-lost", fmt::format("the state of epoch {} is decided anew", e));
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
