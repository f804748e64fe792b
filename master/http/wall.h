// The list of jobs as a wall: its order, and what the farm has done over the day.
#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "master/scheduler/scheduler.h"

namespace candela::master {

// The place of a queued job among those of its priority: virtual time, the lowest first. Nothing: it is not
// queued, or gets no lease now.
std::optional<double> turn_of(const Job& job);

// The place of a job in the list: the lowest first.
struct WallPlace {
  int state = 0;
  bool waits = false;  // queued, and gets no lease now
  std::int64_t minus_priority = 0;
  double turn = 0;
  std::int64_t age = 0;
  std::string id;
  auto operator<=>(const WallPlace&) const = default;
};
// Orders all jobs: failed, the newest first; running by priority, then age; queued in the order in which they
// get their first leases, those that get none now last; paused, done and cancelled, the newest first.
// order.js has the same order. Precondition: the lock of the scheduler is held; it need not be held to sort
// them.
std::vector<WallPlace> wall_places(const Scheduler& scheduler);
std::vector<std::string> wall_order(std::vector<WallPlace> places);

// Load of the farm at one moment.
struct FarmLoad {
  std::uint64_t workers = 0, busy = 0;  // connected; of them with units
  // Until the present workers have rendered what is queued and running. A job that has not been measured
  // counts by the cost of a sample in jobs of its scene, of its integrator, or of the farm.
  double queue_seconds = 0;
  std::uint64_t endless = 0;  // open jobs that it leaves out: without a limit, or of unknown cost
};
FarmLoad load_of(const Scheduler& scheduler, Now now);

struct FarmPoint {
  std::int64_t unix_ms = 0;  // at the end of its minute
  double samples_per_second = 0;
  FarmLoad load;
};

// A point a minute, for a day. A restart of the master empties it.
class FarmHistory {
 public:
  static constexpr std::size_t kMaxPoints = 24 * 60;
  static constexpr double kStepSeconds = 60;

  // Returns the work merged since the last call, and the load now. The first call starts the count.
  FarmPoint look(const Scheduler& scheduler, Now now);
  // True: a point is due; it is kept then.
  bool keep_if_due(const FarmPoint& point, Now now);
  double next_seconds() const { return next_; }
  std::vector<FarmPoint> points() const;

 private:
  std::map<std::string, std::uint64_t> samples_;  // of each job, when it was looked at
  double looked_ = 0, next_ = 0;
  std::int64_t looked_unix_ms_ = 0;
  double minute_samples_ = 0, minute_begin_ = 0;
  std::vector<FarmPoint> ring_;
  std::size_t first_ = 0;  // the oldest, once the ring is full
};

}  // namespace candela::master
