// Looks at the scheduler's invariants after its calls, as an observer of a master (master/options.h).
#pragma once

#include <chrono>
#include <functional>
#include <set>
#include <string>
#include <utility>

#include "master/options.h"
#include "tests/scheduler_invariants.h"

namespace candela::test {

// Tells of the first violation of each invariant. Looks after each call of the scheduler as long as that
// takes at most a tenth of the time, so that a farm of hundreds of workers keeps its pace.
class InvariantWatch {
 public:
  explicit InvariantWatch(std::function<void(const std::string&)> tell) : tell_(std::move(tell)) {}

  void operator()(const master::Scheduler& scheduler) {
    const auto begin = Clock::now();
    if (begin < next_) return;
    for (const std::string& violation : master::check_invariants(scheduler))
      if (told_.insert(violation.substr(0, violation.find(':'))).second) tell_(violation);
    const auto end = Clock::now();
    next_ = end + 9 * (end - begin);
  }

 private:
  using Clock = std::chrono::steady_clock;
  std::function<void(const std::string&)> tell_;
  std::set<std::string> told_;
  Clock::time_point next_{};
};

}  // namespace candela::test
