// JSON for the page beside wire::page_json() of jobs and workers. Unknown numbers (NaN) are null; every
// text is one printable line of UTF-8.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "master/http/wall.h"
#include "master/jobs/convergence.h"
#include "master/jobs/job_status.h"
#include "master/scheduler/scheduler.h"
#include "master/store/records.h"

namespace candela::master {

// One object, field by field.
class JsonObject {
 public:
  JsonObject& add(std::string_view name, std::string_view text);
  JsonObject& add(std::string_view name, const char* text) { return add(name, std::string_view(text)); }
  JsonObject& add(std::string_view name, double value);
  JsonObject& count(std::string_view name, std::uint64_t value);
  JsonObject& number(std::string_view name, std::int64_t value);
  JsonObject& flag(std::string_view name, bool value);
  JsonObject& json(std::string_view name, std::string_view value);  // as it is
  std::string text() const { return text_ + "}"; }

 private:
  void key(std::string_view name);
  std::string text_ = "{";
};
std::string json_string(std::string_view text);
std::string json_array(const std::vector<std::string>& values);  // each is JSON

// Lines of the lists, of which there may be thousands: the fields of wire::page_json() that a list shows,
// under the same names. Seconds are whole, so that a line changes when there is something to see.
// Precondition: the lock of the scheduler is held.
// A job has three fields more: `workers` that render it, `turn` (turn_of()), and `thumbnail`, its revision.
std::string job_line_json(const Scheduler& scheduler, const Job& job, Now now);
std::string worker_line_json(const Scheduler& scheduler, const WorkerState& worker, Now now);

std::string events_page_json(const std::vector<EventRow>& events);
// [unix_ms, samples_per_second, busy, workers, queue_seconds, endless]
std::string point_json(const FarmPoint& point);
std::string convergence_json(const std::vector<ConvergencePoint>& points);

}  // namespace candela::master
