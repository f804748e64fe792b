#include "common/base/work_monitor.h"

namespace candela {
namespace {

thread_local WorkMonitor* monitor_of_thread = nullptr;

}  // namespace

WorkMonitor* watched_work() {
  return monitor_of_thread;
}

WatchedWork::WatchedWork(WorkMonitor* monitor) : before_(monitor_of_thread) {
  monitor_of_thread = monitor;
}

WatchedWork::~WatchedWork() {
  monitor_of_thread = before_;
}

void work_step() {
  WorkMonitor* const monitor = monitor_of_thread;
  if (monitor == nullptr) return;
  monitor->steps.fetch_add(1, std::memory_order_relaxed);
  if (monitor->stop.load(std::memory_order_relaxed)) throw WorkStopped();
}

void work_phase(WorkPhase phase) {
  if (monitor_of_thread != nullptr) monitor_of_thread->phase.store(phase, std::memory_order_relaxed);
  work_step();
}

std::string_view doing(WorkPhase phase) {
  switch (phase) {
    case WorkPhase::waiting:
      return "waiting";
    case WorkPhase::fetching:
      return "fetching files";
    case WorkPhase::reading:
      return "reading the scene";
    case WorkPhase::building:
      return "building the scene";
    case WorkPhase::piloting:
      return "measuring the scene in a pilot";
    case WorkPhase::rendering:
      return "rendering";
    case WorkPhase::pushing:
      return "delivering";
  }
  return "working";
}

}  // namespace candela
