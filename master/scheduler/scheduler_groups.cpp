// Groups of frames, and jobs that wait for others.
//
// A job waits until all that it depends on is done, and fails with the reason when one of these has failed or
// was cancelled; a group is judged when all its jobs have ended. A resumed job waits again.
#include <fmt/format.h>

#include <algorithm>

#include "master/scheduler/scheduler.h"

namespace candela::master {

void Scheduler::join_group(Job& job) {
  if (!job.row.frame) return;
  job.group = &groups_[job.row.frame->group_id];
  job.group->jobs.insert(job.row.id);
  job.group->submitted_unix_ms = std::min(job.group->submitted_unix_ms, job.row.submitted_unix_ms);
}

void Scheduler::leave_group(Job& job) {
  if (job.group == nullptr) return;
  job.group->jobs.erase(job.row.id);
  if (job.group->jobs.empty()) groups_.erase(job.row.frame->group_id);
  job.group = nullptr;
}

std::size_t Scheduler::workers_of(const std::set<std::string>& job_ids) const {
  std::set<std::string_view> workers;
  for (const auto& [token, lease] : leases_)
    if (job_ids.contains(lease.row.job_id)) workers.insert(lease.row.worker_id);
  return workers.size();
}

std::string Scheduler::short_id(const std::string& id) const {
  constexpr std::size_t kMinCharacters = 5;
  std::size_t length = kMinCharacters;
  const auto tell_apart = [&](const std::string& other) {
    if (other == id) return;
    const auto differs = std::mismatch(id.begin(), id.end(), other.begin(), other.end()).first;
    length = std::max(length, static_cast<std::size_t>(differs - id.begin()) + 1);
  };
  const auto look_around = [&](const auto& map) {
    auto next = map.lower_bound(id);
    if (next != map.begin()) tell_apart(std::prev(next)->first);
    if (next != map.end() && next->first == id) ++next;
    if (next != map.end()) tell_apart(next->first);
  };
  look_around(jobs_);
  look_around(groups_);
  return id.substr(0, length);
}

std::optional<std::string> Scheduler::outcome(const std::string& id) const {
  const auto of_job = [&](const Job& job) -> std::optional<std::string> {
    if (!has_ended(job.row.state)) return std::nullopt;
    if (job.row.state == JobState::done) return std::string();
    return fmt::format("job {} ({}) {}{}", job.row.id, job.row.name,
                       job.row.state == JobState::failed ? "has failed" : "was cancelled",
                       job.row.message.empty() ? "" : ": " + job.row.message);
  };
  if (const auto it = jobs_.find(id); it != jobs_.end()) return of_job(it->second);
  const auto group = groups_.find(id);
  if (group == groups_.end()) return fmt::format("there is no job or group '{}'", id);
  std::size_t bad = 0;
  std::string first;
  for (const std::string& member : group->second.jobs) {
    const std::optional<std::string> text = of_job(jobs_.at(member));
    if (!text) return std::nullopt;
    if (!text->empty() && bad++ == 0) first = *text;
  }
  if (bad == 0) return std::string();
  return fmt::format("{} of the {} frames of group {} are not done, such as {}", bad,
                     group->second.jobs.size(), id, first);
}

Result<void> Scheduler::check_dependency(const std::string& id) const {
  if (!jobs_.contains(id) && !groups_.contains(id))
    return input_error(fmt::format("there is no job or group '{}'", id.substr(0, 64))).with_field("depends");
  const std::optional<std::string> text = outcome(id);
  if (!text || text->empty()) return {};
  return refused_error(*text).with_field("depends").with_mend("resume it first, or submit without --depends");
}

void Scheduler::wait_for(const Job& job) {
  if (job.row.depends.empty() || has_ended(job.row.state)) return;
  for (const std::string& id : job.row.depends) dependents_[id].insert(job.row.id);
  dependencies_due_.insert(job.row.id);
}

void Scheduler::tell_dependents(const Job& ended) {
  const auto tell = [&](const std::string& id) {
    if (const auto found = dependents_.find(id); found != dependents_.end())
      dependencies_due_.insert(found->second.begin(), found->second.end());
  };
  tell(ended.row.id);
  if (ended.row.frame) tell(ended.row.frame->group_id);
}

void Scheduler::look_at_dependencies(Now now) {
  for (const std::string& id : std::exchange(dependencies_due_, {})) {
    Job* job = find(id);
    if (job == nullptr || job->row.depends.empty() || has_ended(job->row.state)) continue;
    std::string reason;
    std::vector<std::string> left;
    for (const std::string& on : job->row.depends) {
      const std::optional<std::string> text = outcome(on);
      if (!text || !text->empty()) left.push_back(on);
      if (text && !text->empty() && reason.empty()) reason = *text;
      if (!text) continue;
      const auto waiting = dependents_.find(on);
      if (waiting == dependents_.end()) continue;
      waiting->second.erase(id);
      if (waiting->second.empty()) dependents_.erase(waiting);
    }
    const bool changed = left.size() != job->row.depends.size();
    job->row.depends = std::move(left);
    if (!reason.empty()) {
      fail_job(id, "it depends on what is not done: " + reason, now);
    } else if (changed) {
      if (job->row.depends.empty()) {
        start_fairly(*job);
        event(now, id, "", "dependencies", "all that it depends on is done");
        last_activity_ = now.seconds;
      }
      save(*job, now);
    }
  }
}

std::string Scheduler::dependency_text(const Job& job) const {
  if (job.row.depends.empty()) return {};
  std::vector<std::string> names;
  for (const std::string& id : job.row.depends) {
    const auto other = jobs_.find(id);
    const auto group = groups_.find(id);
    std::string name;
    if (other != jobs_.end()) name = other->second.row.name;
    if (group != groups_.end()) name = jobs_.at(*group->second.jobs.begin()).row.frame->group_name;
    names.push_back(fmt::format("{}{}", id, name.empty() ? "" : " (" + name + ")"));
  }
  return fmt::format("waits for {}", fmt::join(names, ", "));
}

}  // namespace candela::master
