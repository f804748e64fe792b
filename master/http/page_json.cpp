#include "master/http/page_json.h"

#include <fmt/format.h>

#include <cmath>

#include "common/base/text.h"
#include "master/http/thumbnails.h"

namespace candela::master {

std::string json_string(std::string_view text) {
  std::string out = "\"";
  for (const char c : escape_unprintable(text)) {
    if (c == '"' || c == '\\') out += '\\';
    // No text ends a script element or begins a comment, wherever somebody may paste it.
    if (c == '<')
      out += "\\u003c";
    else
      out += c;
  }
  return out + '"';
}

std::string json_array(const std::vector<std::string>& values) {
  std::string out = "[";
  for (const std::string& value : values) out += (out.size() > 1 ? "," : "") + value;
  return out + "]";
}

void JsonObject::key(std::string_view name) {
  if (text_.size() > 1) text_ += ',';
  text_.append(1, '"').append(name).append("\":");
}

JsonObject& JsonObject::add(std::string_view name, std::string_view text) {
  return json(name, json_string(text));
}

JsonObject& JsonObject::add(std::string_view name, double value) {
  return json(name, std::isfinite(value) ? fmt::format("{:.9g}", value) : "null");
}

JsonObject& JsonObject::count(std::string_view name, std::uint64_t value) {
  return json(name, std::to_string(value));
}

JsonObject& JsonObject::number(std::string_view name, std::int64_t value) {
  return json(name, std::to_string(value));
}

JsonObject& JsonObject::flag(std::string_view name, bool value) {
  return json(name, value ? "true" : "false");
}

JsonObject& JsonObject::json(std::string_view name, std::string_view value) {
  key(name);
  text_ += value;
  return *this;
}

std::string job_line_json(const Scheduler& scheduler, const Job& job, Now now) {
  const JobRow& r = job.row;
  const std::uint64_t iterations = r.iterations_of(r.iterations);
  const std::string thumbnail = thumbnail_revision(job);
  // A value of 0 that means "not set" or "not known yet" becomes null.
  const auto known = [](bool is, double value) { return is ? value : std::nan(""); };
  return JsonObject()
      .add("id", r.id)
      .add("name", r.name)
      .add("submitter", r.submitter)
      .add("state", name(r.state))
      .number("priority", r.priority)
      .add("share", r.share)
      .json("settings", JsonObject().add("integrator", r.settings.integrator).text())
      .count("iterations", iterations)
      .json("iterations_asked", r.iterations_asked() > 0 ? std::to_string(r.iterations_asked()) : "null")
      .json("stop", JsonObject()
                        .add("time_seconds", known(r.stop.time_seconds > 0, r.stop.time_seconds))
                        .add("relmse", known(r.stop.relmse > 0, r.stop.relmse))
                        .text())
      .add("error", known(iterations > 0, r.relmse))
      .add("error_upper", known(iterations > 0 && r.relmse_upper > 0, r.relmse_upper))
      .add("elapsed_seconds", std::floor(r.elapsed_seconds))
      .add("eta_seconds", std::ceil(scheduler.eta_seconds(job, now)))
      .json("submitted_unix_ms", r.submitted_unix_ms > 0 ? std::to_string(r.submitted_unix_ms) : "null")
      .json("finished_unix_ms",
            has_ended(r.state) && r.finished_unix_ms > 0 ? std::to_string(r.finished_unix_ms) : "null")
      .add("message", scheduler.message_of(job, now))
      .json("group", r.frame ? JsonObject()
                                   .add("id", r.frame->group_id)
                                   .add("name", r.frame->group_name)
                                   .number("frame", r.frame->frame)
                                   .count("frames", r.frame->frames)
                                   .text()
                             : "null")
      .count("workers", job.under_way)
      .add("turn", turn_of(job).value_or(std::nan("")))
      .json("thumbnail", thumbnail.empty() ? "null" : json_string(thumbnail))
      .text();
}

std::string point_json(const FarmPoint& p) {
  const auto number = [](double v) { return std::isfinite(v) ? fmt::format("{:.5g}", v) : "null"; };
  return fmt::format("[{},{},{},{},{},{}]", p.unix_ms, number(p.samples_per_second), p.load.busy,
                     p.load.workers, number(p.load.queue_seconds), p.load.endless);
}

std::string worker_line_json(const Scheduler& scheduler, const WorkerState& w, Now now) {
  std::vector<std::string> jobs;
  for (const std::string& job : scheduler.jobs_of(w)) jobs.push_back(json_string(job));
  return JsonObject()
      .add("id", w.row.id)
      .add("name", w.row.name)
      .add("host", w.row.host)
      .add("state", scheduler.worker_state_name(w, now))
      .count("threads", w.row.threads)
      .count("units_merged", w.row.units_merged)
      .count("units_failed", w.row.units_failed)
      .json("jobs", json_array(jobs))
      .add("message", message_of(scheduler, w, now))
      .text();
}

std::string events_page_json(const std::vector<EventRow>& events) {
  std::vector<std::string> out;
  for (const EventRow& e : events)
    out.push_back(JsonObject()
                      .number("unix_ms", e.unix_ms)
                      .add("job", e.job_id)
                      .add("worker", e.worker_id)
                      .add("kind", e.kind)
                      .add("message", e.message)
                      .text());
  return json_array(out);
}

std::string convergence_json(const std::vector<ConvergencePoint>& points) {
  std::string out = "[";
  for (const ConvergencePoint& p : points)
    out +=
        fmt::format("{}[{},{:.9g},{:.9g},{}]", out.size() > 1 ? "," : "", p.iterations, p.elapsed_seconds,
                    p.relmse, std::isfinite(p.relmse_upper) ? fmt::format("{:.9g}", p.relmse_upper) : "null");
  return out + "]";
}

}  // namespace candela::master
