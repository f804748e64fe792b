#include "master/http/wall.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <utility>

#include "common/film/index_set.h"

namespace candela::master {
namespace {

int rank_of(JobState state) {
  constexpr int kRanks[] = {2, 1, 3, 4, 0, 5};  // queued, running, paused, done, failed, cancelled
  static_assert(std::size(kRanks) == static_cast<std::size_t>(JobState::cancelled) + 1);
  return kRanks[static_cast<std::size_t>(state)];
}

// Sum and number of measured costs.
struct Cost {
  double sum = 0;
  std::uint64_t jobs = 0;
  void add(double cost) {
    sum += cost;
    ++jobs;
  }
};

double pixels_of(const JobRow& row) {
  return std::max(1.0, static_cast<double>(row.settings.width) * row.settings.height);
}

// Thread seconds of one index; 0: not measured.
double cost_of(const Job& job) {
  return job.thread_seconds > 0 ? job.thread_seconds : job.row.thread_seconds_per_iteration;
}

// Indices that are left by the limit that ends the job first, its time apart; infinity: no limit is known.
double indices_left(const Job& job) {
  double left = std::numeric_limits<double>::infinity();
  const JobRow& r = job.row;
  const auto done = static_cast<double>(r.iterations);
  if (!film::empty(r.stop_indices))
    left = static_cast<double>(count(without(r.stop_indices, job.merged)));
  else if (r.stop.iterations > 0)
    left = static_cast<double>(r.stop.iterations) * static_cast<double>(r.indices_per_iteration()) - done;
  if (r.stop.relmse > 0 && r.relmse_upper > 0)
    left = std::min(left, done * (r.relmse_upper / r.stop.relmse - 1));
  return std::max(left, 0.0);
}

}  // namespace

std::optional<double> turn_of(const Job& job) {
  if (job.row.state != JobState::queued || !job.open_for_leases()) return std::nullopt;
  return job.virtual_time;
}

std::vector<WallPlace> wall_places(const Scheduler& scheduler) {
  std::vector<WallPlace> out;
  out.reserve(scheduler.jobs().size());
  for (const auto& [id, job] : scheduler.jobs()) {
    const JobRow& r = job.row;
    WallPlace place{.state = rank_of(r.state), .id = id};
    if (r.state == JobState::running || r.state == JobState::queued) {
      const auto turn = turn_of(job);
      place.waits = r.state == JobState::queued && !turn;
      place.minus_priority = -std::int64_t{r.priority};
      place.turn = turn.value_or(0);
      place.age = r.submitted_unix_ms;
    } else {
      place.age = -(has_ended(r.state) ? r.finished_unix_ms : r.submitted_unix_ms);
    }
    out.push_back(std::move(place));
  }
  return out;
}

std::vector<std::string> wall_order(std::vector<WallPlace> places) {
  std::sort(places.begin(), places.end(),
            [](const WallPlace& a, const WallPlace& b) { return (a <=> b) < 0; });
  std::vector<std::string> out;
  out.reserve(places.size());
  for (WallPlace& place : places) out.push_back(std::move(place.id));
  return out;
}

FarmLoad load_of(const Scheduler& scheduler, Now now) {
  FarmLoad out;
  double threads = 0;
  for (const auto& [id, worker] : scheduler.workers()) {
    const std::string state = scheduler.worker_state_name(worker, now);
    if (state == "lost" || state == "awaited") continue;
    ++out.workers;
    out.busy += worker.leases.empty() ? 0 : 1;
    if (state == "idle" || state == "busy") threads += std::max(worker.row.threads, 1U);
  }
  std::vector<const Job*> open;
  // Costs of a sample where they are needed: by scene and integrator, by integrator, and of all.
  using Key = std::pair<std::string_view, std::string_view>;
  std::map<Key, Cost> costs;
  const auto keys_of = [](const Job& job) {
    const std::string_view integrator = job.row.settings.integrator;
    return std::array<Key, 3>{Key{job.row.bundle_sha256, integrator}, {"", integrator}, {"", ""}};
  };
  for (const auto& [id, job] : scheduler.jobs()) {
    if (job.row.state != JobState::queued && job.row.state != JobState::running) continue;
    open.push_back(&job);
    if (cost_of(job) > 0) continue;
    for (const Key& key : keys_of(job)) costs.try_emplace(key);
  }
  if (!costs.empty())
    for (const auto& [id, job] : scheduler.jobs())
      if (const double cost = cost_of(job); cost > 0)
        for (const Key& key : keys_of(job))
          if (const auto it = costs.find(key); it != costs.end()) it->second.add(cost / pixels_of(job.row));
  const auto expected = [&](const Job& job) {
    if (const double cost = cost_of(job); cost > 0) return cost;
    for (const Key& key : keys_of(job))
      if (const Cost& known = costs.at(key); known.jobs > 0)
        return known.sum / static_cast<double>(known.jobs) * pixels_of(job.row);
    return 0.0;
  };
  double work = 0, longest = 0;  // thread seconds; seconds
  for (const Job* job : open) {
    const double left = indices_left(*job), cost = expected(*job);
    const bool counted = std::isfinite(left) && (cost > 0 || left == 0);
    const double seconds = std::max(job->row.stop.time_seconds - job->row.elapsed_seconds, 0.0);
    const bool timed = job->row.stop.time_seconds > 0;
    if (timed && (!counted || left * cost > seconds * threads))
      longest = std::max(longest, seconds);  // jobs whose time runs do so beside each other
    else if (counted)
      work += left * cost;
    else
      ++out.endless;
  }
  out.queue_seconds = std::max(threads > 0 ? work / threads
                               : work > 0  ? std::numeric_limits<double>::infinity()
                                           : 0,
                               longest);
  return out;
}

FarmPoint FarmHistory::look(const Scheduler& scheduler, Now now) {
  const bool first = looked_unix_ms_ == 0;
  double merged = 0;
  std::map<std::string, std::uint64_t> samples;
  for (const auto& [id, job] : scheduler.jobs()) {
    const std::uint64_t here = job.row.sample_counts.eye_samples;
    const auto before = samples_.find(id);
    if (before != samples_.end())
      merged += here > before->second ? static_cast<double>(here - before->second) : 0;
    else if (!first && job.row.submitted_unix_ms >= looked_unix_ms_)
      merged += static_cast<double>(here);
    if (before != samples_.end() || !has_ended(job.row.state)) samples.emplace(id, here);
  }
  // An ended job was counted to its end, and is not looked at any more.
  std::erase_if(samples, [&](const auto& one) { return has_ended(scheduler.job(one.first)->row.state); });
  samples_ = std::move(samples);
  if (first) minute_begin_ = now.seconds;
  if (first) next_ = now.seconds + kStepSeconds;
  looked_ = now.seconds;
  looked_unix_ms_ = now.unix_ms;
  minute_samples_ += merged;
  const double seconds = now.seconds - minute_begin_;
  return {now.unix_ms, seconds > 0 ? minute_samples_ / seconds : 0, load_of(scheduler, now)};
}

bool FarmHistory::keep_if_due(const FarmPoint& point, Now now) {
  if (now.seconds < next_) return false;
  if (ring_.size() < kMaxPoints) {
    ring_.push_back(point);
  } else {
    ring_[first_] = point;
    first_ = (first_ + 1) % kMaxPoints;
  }
  minute_samples_ = 0;
  minute_begin_ = now.seconds;
  next_ = now.seconds + kStepSeconds;
  return true;
}

std::vector<FarmPoint> FarmHistory::points() const {
  std::vector<FarmPoint> out(ring_.begin() + static_cast<std::ptrdiff_t>(first_), ring_.end());
  out.insert(out.end(), ring_.begin(), ring_.begin() + static_cast<std::ptrdiff_t>(first_));
  return out;
}

}  // namespace candela::master
