// Wakes the master's threads before their time, and tells them to end.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>

#include "common/base/mutex.h"

namespace candela::master {

class WakeSignal {
 public:
  bool stopping() const { return stopping_.load(); }
  void wake() { wake_.notify_all(); }
  void stop() {
    stopping_ = true;
    wake();
  }
  // Returns after `seconds` at the latest. A wake-up that comes just before the sleep is missed, so threads
  // sleep for fractions of a second only.
  void sleep(double seconds) {
    Lock lock(mutex_);
    wake_.wait_for(lock, std::chrono::duration<double>(seconds));
  }

 private:
  std::atomic<bool> stopping_{false};
  Mutex mutex_;
  std::condition_variable wake_;
};

}  // namespace candela::master
