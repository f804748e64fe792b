// Decides when a part of the page is made anew.
#pragma once

#include <algorithm>
#include <limits>

namespace candela::master {

// Spends at most a share of a core on what it guards. A list that many people watch may not lag without end:
// it gives a longest pause, and may then spend more.
class RefreshBudget {
 public:
  bool due(double now) const { return now >= next_; }

  // A refresh took `processor_seconds` of a core and ended at `now` (seconds). The next one is due after
  // `pause` seconds at least, `longest` at most, and in between when its share of the time has paid for it.
  void spent(double now, double processor_seconds, double pause, double share,
             double longest = std::numeric_limits<double>::infinity()) {
    next_ = now + std::min(std::max(pause, processor_seconds / share), std::max(pause, longest));
  }

  void reset() { next_ = 0; }

 private:
  double next_ = 0;
};

}  // namespace candela::master
