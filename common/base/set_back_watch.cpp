#include "common/base/set_back_watch.h"

#include <algorithm>
#include <ctime>

namespace candela {
namespace {

SetBackWatch::Seconds time_of(clockid_t clock) {
  timespec now{};
  ::clock_gettime(clock, &now);
  return std::chrono::seconds(now.tv_sec) + std::chrono::nanoseconds(now.tv_nsec);
}

}  // namespace

std::optional<SetBackWatch::Seconds> SetBackWatch::look(Seconds wall, Seconds steady) {
  const Seconds ahead = wall - steady;
  if (!ahead_) ahead_ = ahead;
  const Seconds back = *ahead_ - ahead;
  if (back > limit_) {
    ahead_ = ahead;
    return back;
  }
  ahead_ = std::max(*ahead_, ahead);
  return std::nullopt;
}

// The steady clock counts what the machine sleeps, too: so does the wall clock.
std::optional<SetBackWatch::Seconds> SetBackWatch::look() {
  return look(time_of(CLOCK_REALTIME), time_of(CLOCK_BOOTTIME));
}

}  // namespace candela
