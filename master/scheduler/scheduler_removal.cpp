// Jobs that are removed: out of sight at once, out of memory when nobody can work with them any more.
#include "master/scheduler/scheduler.h"

namespace candela::master {
namespace {

constexpr double kWithdrawnSeconds = 3600;  // longer than any call that asked for the job before

}  // namespace

bool Scheduler::withdraw(const std::string& id, std::int64_t finished_unix_ms, Now now) {
  const auto it = jobs_.find(id);
  if (it == jobs_.end() || !has_ended(it->second.row.state) || it->second.finishing ||
      it->second.row.finished_unix_ms != finished_unix_ms)
    return false;
  leave_group(it->second);
  withdrawn_[id] = {jobs_.extract(it), now.seconds};
  return true;
}

void Scheduler::put_back(const std::string& id) {
  const auto it = withdrawn_.find(id);
  if (it == withdrawn_.end()) return;
  join_group(jobs_.insert(std::move(it->second.node)).position->second);
  withdrawn_.erase(it);
}

void Scheduler::forget(const std::string& id, const std::string& text, Now now) {
  changes_.emplace_back(DropJob{id});
  event(now, id, "", "removed", text);
  std::erase_if(withdrawn_,
                [&](const auto& entry) { return now.seconds - entry.second.seconds > kWithdrawnSeconds; });
}

}  // namespace candela::master
