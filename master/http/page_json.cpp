#include "master/http/page_json.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "common/base/text.h"

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

namespace {

std::string text_map(const SettingsMap& map) {
  std::string out = "{";
  for (const auto& [name, value] : map)
    out += fmt::format("{}{}:{}", out.size() > 1 ? "," : "", json_string(name), json_string(value));
  return out + "}";
}

std::string lines_of(std::string_view text) {
  std::vector<std::string> lines;
  while (!text.empty()) {
    const std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(text.size(), line.size() + 1));
    lines.push_back(json_string(line));
  }
  return json_array(lines);
}

std::string failures_of(const FailureCounts& counts) {
  JsonObject out;
  for (const FailureCause cause : kAllFailureCauses)
    if (const std::uint64_t n = counts[index_of(cause)]; n > 0) out.count(name(cause), n);
  return out.text();
}

std::string chains_of(const JobStatus& status) {
  std::vector<std::string> groups;
  for (const chains::ChainCounts& g : status.row.chain_summary.groups)
    groups.push_back(JsonObject()
                         .count("mutations", g.mutations)
                         .count("accepted", g.accepted)
                         .count("large_steps", g.large_steps)
                         .count("longest_stay", g.longest_stay)
                         .text());
  const chains::Normalisation b = status.normalisation();
  return JsonObject()
      .count("chains", status.row.chains->chains)
      .count("bootstrap_samples", status.row.chains->bootstrap_samples)
      .count("bootstrap_done", status.bootstrap_done)
      .add("b", b.b)
      .add("b_standard_error", b.standard_error)
      .count("b_samples", b.samples)
      .json("groups", json_array(groups))
      .text();
}

std::string epochs_of(const EpochStatus& epochs) {
  std::vector<std::string> figures;
  for (const auto& [name, value] : epochs.figures)
    figures.push_back(JsonObject().add("name", name).add("value", value).text());
  return JsonObject()
      .count("epoch", epochs.epoch)
      .count("first_iteration", epochs.first_iteration)
      .count("iterations", epochs.iterations)
      .count("statistics_bytes", epochs.statistics_bytes)
      .json("figures", json_array(figures))
      .text();
}

}  // namespace

std::string job_line_json(const Scheduler& scheduler, const Job& job, Now now) {
  const JobRow& r = job.row;
  return JsonObject()
      .add("id", r.id)
      .add("name", r.name)
      .add("submitter", r.submitter)
      .add("state", name(r.state))
      .number("priority", r.priority)
      .add("share", r.share)
      .add("integrator", r.settings.integrator)
      .count("iterations", r.iterations_of(r.iterations))
      .count("stop_iterations", r.iterations_asked())
      .add("stop_seconds", r.stop.time_seconds)
      .add("stop_relmse", r.stop.relmse)
      .add("relmse", r.relmse)
      .add("relmse_upper", r.relmse_upper)
      .add("elapsed_seconds", std::floor(r.elapsed_seconds))
      .add("eta_seconds", std::ceil(scheduler.eta_seconds(job, now)))
      .number("submitted_unix_ms", r.submitted_unix_ms)
      .add("message", scheduler.message_of(job, now))
      .text();
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
      .add("message", w.distrusted ? scheduler.distrusted().at(identity(w.row)).reason : w.message)
      .text();
}

std::string job_page_json(const JobStatus& status) {
  const JobRow& r = status.row;
  const JobSettings& settings = r.settings;
  JsonObject rejected;
  const auto counts = status.rejected();
  for (std::size_t i = 0; i < counts.size(); ++i)
    if (counts[i] > 0) rejected.count(film::name(static_cast<film::RejectCause>(i)), counts[i]);
  std::vector<std::string> layers;
  for (const std::string& layer : status.layers()) layers.push_back(json_string(layer));
  JsonObject out;
  out.add("id", r.id)
      .add("name", r.name)
      .add("submitter", r.submitter)
      .add("state", name(r.state))
      .add("message", status.message)
      .number("priority", r.priority)
      .add("share", r.share)
      .json("settings", JsonObject()
                            .add("integrator", settings.integrator)
                            .json("integrator_settings", text_map(settings.integrator_settings))
                            .count("width", settings.width)
                            .count("height", settings.height)
                            .add("filter", settings.filter)
                            .json("filter_settings", text_map(settings.filter_settings))
                            .add("sampler", settings.sampler)
                            .add("seed", std::to_string(settings.seed))
                            .add("isa", settings.isa)
                            .add("aovs", settings.aovs)
                            .text())
      .count("stop_iterations", r.iterations_asked())
      .add("stop_seconds", r.stop.time_seconds)
      .add("stop_relmse", r.stop.relmse)
      .add("stop_indices", film::empty(r.stop_indices) ? "" : film::text_of(r.stop_indices))
      .add("bundle", r.bundle_sha256)
      .count("iterations", status.iterations())
      .count("samples", r.tallies.eye_samples)
      .count("rays", r.tallies.rays)
      .count("light_paths", r.tallies.light_paths)
      .add("relmse", r.relmse)
      .add("relmse_upper", r.relmse_upper)
      .count("units_merged", r.units_merged)
      .count("units_leased", status.units_leased)
      .add("elapsed_seconds", r.elapsed_seconds)
      .add("worker_seconds", r.worker_seconds)
      .add("samples_per_second", status.samples_per_second)
      .add("eta_seconds", status.eta_seconds)
      .number("submitted_unix_ms", r.submitted_unix_ms)
      .number("finished_unix_ms", r.finished_unix_ms)
      .count("checkpoint_iterations", status.checkpoint_iterations())
      .count("lost", status.lost)
      .count("worker_memory_bytes", status.worker_memory_bytes)
      .json("rejected", rejected.text())
      .json("failures", failures_of(status.failures))
      .json("layers", json_array(layers))
      .json("plan", lines_of(r.plan));
  std::vector<std::string> taints;
  for (const Taint& taint : r.audit.taints) taints.push_back(json_string(taint_text(taint)));
  out.json("taints", json_array(taints));
  if (r.chains) out.json("chains", chains_of(status));
  if (status.epochs) out.json("epochs", epochs_of(*status.epochs));
  return out.text();
}

std::string worker_page_json(const WorkerStatus& status) {
  const WorkerRow& w = status.row;
  std::vector<std::string> jobs;
  for (const std::string& job : status.jobs) jobs.push_back(json_string(job));
  return JsonObject()
      .add("id", w.id)
      .add("name", w.name)
      .add("host", w.host)
      .add("state", status.state)
      .add("build_id", w.build_id)
      .count("threads", w.threads)
      .count("units_merged", w.units_merged)
      .count("units_failed", w.units_failed)
      .count("resident_bytes", status.resident_bytes)
      .number("last_seen_unix_ms", w.last_seen_unix_ms)
      .json("failures", failures_of(status.failures))
      .json("jobs", json_array(jobs))
      .add("message", status.message)
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
