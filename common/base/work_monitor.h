// Stops work that takes long, and shows that it goes on.
//
// Readers, loaders and builders call work_step() in their long loops. Without a monitor the call does nothing
// (in the client). With one it counts a step, and throws WorkStopped if the work is to stop. The monitor
// belongs to the calling thread, so it need not be a parameter of a hundred functions; a loop that hands work
// to other threads hands the monitor to them, too (WatchedWork).
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace candela {

// The phases of a unit at its worker, in order. The worker computes nothing for a unit that waits or is
// pushed.
enum class WorkPhase : std::uint8_t { waiting, fetching, reading, building, piloting, rendering, pushing };
// "building the scene"
std::string_view doing(WorkPhase phase);

struct WorkMonitor {
  std::atomic<bool> stop{false};
  std::atomic<std::uint64_t> steps{0};  // grows while the work goes on
  std::atomic<WorkPhase> phase{WorkPhase::waiting};
};

// Thrown by work_step(). Not a std::exception: a reader that turns exceptions into errors of a file must not
// take a stop for one.
struct WorkStopped {};

// The calling thread's monitor; null: none.
WorkMonitor* watched_work();

// The monitor of this thread's work, for the life of this object.
class WatchedWork {
 public:
  explicit WatchedWork(WorkMonitor* monitor);
  ~WatchedWork();
  WatchedWork(const WatchedWork&) = delete;
  WatchedWork& operator=(const WatchedWork&) = delete;

 private:
  WorkMonitor* before_;
};

// The thread's work enters this phase, which is a step.
void work_phase(WorkPhase phase);

// One step of long work, at best every millisecond or so.
void work_step();

// The same for step `i` of a loop of short steps: every 1024th is told.
inline void work_step(std::size_t i) {
  if ((i & 1023) == 0) work_step();
}

}  // namespace candela
