// The end of a job whose time is up: if one half is a little behind the other, or units in the middle are not
// there yet, the job renders what is missing before it ends.
#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <set>
#include <string>

#include "master/scheduler/scheduler.h"

namespace candela::master {
namespace {

// The time limit is exceeded by at most a unit's time, and by at most this part of itself.
constexpr double kPartOfTime = 0.25;

}  // namespace

double Scheduler::level_seconds(const Job& job, std::uint64_t missing) const {
  // Workers that are at work on the job can do it.
  std::set<std::string> at_work;
  for (const auto& [token, lease] : leases_)
    if (lease.row.job_id == job.row.id) at_work.insert(lease.row.worker_id);
  double threads = 0, longest = 0;
  for (const std::string& id : at_work) {
    const WorkerState& worker = workers_.at(id);
    threads += std::max(worker.row.threads, 1U);
    longest = std::max(longest, seconds_per_iteration(job, worker));
  }
  if (threads == 0 || !(job.thread_seconds > 0)) return std::numeric_limits<double>::infinity();
  return std::max(static_cast<double>(missing) * job.thread_seconds / threads, longest);
}

bool Scheduler::levels_halves(Job& job, Now now) {
  const HalfSets before = job.level.value_or(HalfSets());
  const std::uint64_t end = std::max(end_of(job.merged[0]), end_of(job.merged[1]));
  HalfSets level;
  for (std::uint32_t h = 0; h < 2; ++h) {
    const std::uint64_t limit =
        job.row.stop.iterations > 0 ? job.row.indices_of(h, job.row.stop.iterations) : end;
    level[h].insert(0, std::min(end, limit));
  }
  const std::uint64_t missing = count(without(level, job.merged));
  if (missing == 0) return false;
  if (job.level) {
    if (now.seconds >= job.level_until) return false;
  } else {
    const double most = std::min(options_.unit_seconds, kPartOfTime * job.row.stop.time_seconds);
    if (level_seconds(job, missing) > most) return false;
    job.level_until = now.seconds + most;
  }
  if (level == before) return true;
  const bool first = !job.level;
  job.level = std::move(level);  // again if a delta was on its way that brought more
  if (first) event(now, job.row.id, "", "leveling", level_text(job));
  drop_unwanted_units(job, now);
  rebuild_reserved(job);
  last_activity_ = now.seconds;
  return true;
}

void Scheduler::drop_unwanted_units(Job& job, Now now) {
  const HalfSets& asked = *job.asked();
  for (auto next = job.units.begin(); next != job.units.end();) {
    const auto unit = next++;
    const Unit& u = unit->second.row.unit;
    if (unit->second.audit && unit->second.audit->recheck) continue;
    if (contains(asked[u.half], u.begin, u.end)) continue;
    const std::vector<std::uint64_t> tokens = unit->second.leases;
    for (const std::uint64_t token : tokens) take_away(token, now, true);
    changes_.emplace_back(DropUnit{unit->first});
    job.held.erase(unit->first);
    job.units.erase(unit);
  }
}

std::string Scheduler::level_text(const Job& job) {
  return fmt::format("the time is up; {} {} more, so that no half of the image is behind",
                     count(without(*job.level, job.merged)), job.source->noun());
}

}  // namespace candela::master
