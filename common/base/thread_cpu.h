// CPU time of the calling thread.
#pragma once

#include <ctime>

namespace candela {

inline double thread_cpu_seconds() {
  timespec t{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

// Runs `work` and adds the CPU time that it takes on this thread to `seconds`.
template <class F>
auto with_cpu_time(double& seconds, F&& work) {
  struct Watch {
    double& seconds;
    double begun = thread_cpu_seconds();
    ~Watch() { seconds += thread_cpu_seconds() - begun; }
  };
  const Watch watch{seconds};
  return work();
}

}  // namespace candela
