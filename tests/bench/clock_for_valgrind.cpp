// The clock of libhwy (under OpenImageIO) for programs that Callgrind runs, loaded before it (LD_PRELOAD):
// libhwy's own reads RDTSCP while it is loaded, wherever the CPU has it, and Valgrind 3.19 knows no such
// instruction. No render asks this clock.
#include <cstdint>

namespace hwy::platform {
double Now();
std::uint64_t TimerResolution();
double InvariantTicksPerSecond();

double Now() {
  return 0.0;
}
std::uint64_t TimerResolution() {
  return 1;
}
double InvariantTicksPerSecond() {
  return 1e9;
}
}  // namespace hwy::platform
