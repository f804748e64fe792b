#include "common/base/work_monitor.h"

#include "common/base/enum_names.h"

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
  return name_of_value<WorkPhase::pushing>(
      {"waiting", "fetching files", "reading the scene", "building the scene",
       "measuring the scene in a pilot", "rendering", "delivering"},
      phase, "working");
}

}  // namespace candela
