// Ctrl-C and its kin as a state that loops look at: the first signal asks to stop, the second ends the
// process at once.
#pragma once

#include <chrono>

namespace candela::client {

// While one lives, SIGINT, SIGTERM and SIGHUP are noted instead of deadly. One at a time (the handlers are
// the process's).
class StopSignals {
 public:
  StopSignals();
  ~StopSignals();
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

  int pending() const;  // the signal's number, or 0
  // Sleeps until a signal is pending or the time is over; true if one is pending. Callable from any thread.
  bool wait_for(std::chrono::milliseconds time) const;
};

}  // namespace candela::client
