#include "client/json.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "client/progress.h"
#include "common/base/text.h"
#include "common/base/version.h"
#include "common/wire/wire.h"

namespace candela::client {
namespace {

using Json = nlohmann::ordered_json;

std::string text(const Json& json) {
  return escape_json_unprintable(json.dump(2, ' ', false, Json::error_handler_t::replace));
}

Json finite(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);
}
Json limit(double value) {
  return value > 0 ? Json(value) : Json(nullptr);
}
Json time_ms(std::int64_t value) {
  return value > 0 ? Json(value) : Json(nullptr);
}

Json map(const google::protobuf::Map<std::string, std::string>& values) {
  // Protobuf's maps have no order; ours do.
  const std::map<std::string, std::string> sorted(values.begin(), values.end());
  Json json = Json::object();
  for (const auto& [key, value] : sorted) json[key] = value;
  return json;
}

// Every cause by its name, those that never came included.
Json failures(const google::protobuf::RepeatedPtrField<v1::FailureCount>& counts) {
  Json json;
  for (const FailureCause cause : kAllFailureCauses) json[std::string(name(cause))] = 0;
  for (const auto& f : counts) json[std::string(name(wire::from_proto(f.cause())))] = f.count();
  return json;
}

Json chains(const v1::ChainStatus& c) {
  Json json;
  json["chains"] = c.plan().chains();
  json["segment_mutations"] = c.plan().segment_mutations();
  json["bootstrap_samples"] = c.plan().bootstrap_samples();
  json["bootstrap_done"] = c.bootstrap_done();
  json["b"] = finite(c.b());
  json["b_standard_error"] = finite(c.b_standard_error());
  json["b_samples"] = c.b_samples();
  json["groups"] = Json::array();
  for (const v1::ChainGroupStatus& g : c.groups())
    json["groups"].push_back({{"mutations", g.mutations()},
                              {"accepted", g.accepted()},
                              {"large_steps", g.large_steps()},
                              {"large_accepted", g.large_accepted()},
                              {"longest_stay", g.longest_stay()},
                              {"stay_pixel", {finite(g.stay_x()), finite(g.stay_y())}}});
  return json;
}

Json epochs(const v1::EpochStatus& e) {
  Json json;
  json["epoch"] = e.epoch();
  json["first_iteration"] = e.first_iteration();
  json["iterations"] = e.iterations();
  json["statistics_bytes"] = e.statistics_bytes();
  json["received_bytes"] = e.received_bytes();
  json["figures"] = Json::object();
  for (const v1::Figure& figure : e.figures()) json["figures"][figure.name()] = finite(figure.value());
  return json;
}

Json job(const v1::JobStatus& s) {
  Json json;
  const std::string indices = indices_text(s);
  json["id"] = s.id();
  json["name"] = s.name();
  json["submitter"] = s.submitter();
  json["state"] = std::string(wire::name(s.state()));
  json["message"] = s.message();
  json["units_merged"] = s.units_merged();
  json["units_leased"] = s.units_leased();
  json["iterations"] = s.iterations();
  const double each = samples_per_iteration(s);
  json["samples_per_pixel"] = each > 0 ? Json(each * static_cast<double>(s.iterations())) : Json(nullptr);
  json["lost"] = s.lost();
  json["repairing"] = s.repairing();
  json["samples"] = s.samples();
  json["light_paths"] = s.light_paths();
  json["rays"] = s.rays();
  // Before the first merge the estimate has no meaning, whatever the field holds.
  json["error"] = s.iterations() > 0 ? finite(s.relmse_estimate()) : Json(nullptr);
  json["error_upper"] = s.iterations() > 0 && s.relmse_upper() > 0 ? finite(s.relmse_upper()) : Json(nullptr);
  json["samples_per_second"] = finite(s.samples_per_second());
  json["eta_seconds"] = finite(s.eta_seconds());
  json["elapsed_seconds"] = finite(s.elapsed_seconds());
  json["worker_seconds"] = finite(s.worker_seconds());
  json["priority"] = s.priority();
  json["share"] = finite(s.share());
  json["stop"] = {{"iterations", s.stop().iterations() > 0 ? Json(s.stop().iterations()) : Json(nullptr)},
                  {"time_seconds", limit(s.stop().time_seconds())},
                  {"relmse", limit(s.stop().relmse())},
                  {"indices", indices.empty() ? Json(nullptr) : Json(indices)}};
  const v1::JobSettings& settings = s.settings();
  json["settings"] = {{"integrator", settings.integrator()},
                      {"integrator_settings", map(settings.integrator_settings())},
                      {"width", settings.width()},
                      {"height", settings.height()},
                      {"filter", settings.filter()},
                      {"filter_settings", map(settings.filter_settings())},
                      {"sampler", settings.sampler()},
                      {"seed", settings.seed()},
                      {"isa", settings.isa()},
                      {"aovs", settings.aovs()}};
  json["bundle_sha256"] = s.bundle_sha256();
  json["scene_path"] = s.scene_path();
  json["film_scale_log2"] = s.has_named_state() ? Json(s.named_state().film_scale_log2()) : Json(nullptr);
  json["failures"] = failures(s.failures());
  json["waiting"] = nullptr;
  if (s.has_waiting())
    json["waiting"] = {{"cause", std::string(name(wire::from_proto(s.waiting().cause())))},
                       {"units", s.waiting().units()},
                       {"retry_unix_ms", time_ms(s.waiting().retry_unix_ms())}};
  Json rejected = Json::object();
  for (const auto& entry : s.rejected()) rejected[entry.cause()] = entry.count();
  json["rejected_samples"] = rejected;
  json["bounded_walks"] = s.bounded_walks();
  json["checkpoint"] = {{"generation", s.checkpoint_generation()}, {"iterations", s.checkpoint_iterations()}};
  json["submitted_unix_ms"] = time_ms(s.submitted_unix_ms());
  json["finished_unix_ms"] = time_ms(s.finished_unix_ms());
  json["bootstrap_b"] =
      s.has_chains() && s.has_named_state() ? finite(s.named_state().bootstrap_b()) : Json(nullptr);
  json["chains"] = s.has_chains() ? chains(s.chains()) : Json(nullptr);
  json["epochs"] = s.has_epochs() ? epochs(s.epochs()) : Json(nullptr);
  json["layers"] = Json::array();
  for (const std::string& layer : s.layers()) json["layers"].push_back(layer);
  json["worker_memory_bytes"] = s.worker_memory_bytes();
  json["taints"] = Json::array();
  for (const v1::Taint& taint : s.taints())
    json["taints"].push_back({{"worker", taint.worker()},
                              {"since_unix_ms", time_ms(taint.since_unix_ms())},
                              {"units", taint.units()}});
  json["plan"] = s.plan();
  return json;
}

Json distrusted(const v1::DistrustedWorker& d) {
  return {{"worker", d.worker()}, {"since_unix_ms", time_ms(d.since_unix_ms())}, {"reason", d.reason()}};
}

Json worker(const v1::WorkerStatus& w) {
  Json json;
  json["id"] = w.id();
  json["name"] = w.name();
  json["state"] = w.state();
  json["message"] = w.message();
  json["host"] = w.host();
  json["threads"] = w.threads();
  json["units_merged"] = w.units_merged();
  json["units_failed"] = w.units_failed();
  json["resident_bytes"] = w.resident_bytes();
  json["failures"] = failures(w.failures());
  json["jobs"] = Json::array();
  for (const std::string& id : w.jobs()) json["jobs"].push_back(id);
  json["last_seen_unix_ms"] = time_ms(w.last_seen_unix_ms());
  json["build_id"] = w.build_id();
  return json;
}

}  // namespace

std::string trust_json(const v1::TrustResponse& response) {
  return text(distrusted(response.worker()));
}

std::string job_json(const v1::JobStatus& status) {
  return text(job(status));
}

std::string jobs_json(const v1::ListJobsResponse& response) {
  Json list = Json::array();
  for (const auto& status : response.jobs()) list.push_back(job(status));
  const std::string& next = response.next_page_token();
  return text({{"jobs", list}, {"total", response.total()}, {"next", next.empty() ? Json() : Json(next)}});
}

std::string worker_json(const v1::WorkerStatus& status) {
  return text(worker(status));
}

std::string workers_json(const v1::ListWorkersResponse& response) {
  Json list = Json::array();
  for (const auto& status : response.workers()) list.push_back(worker(status));
  Json distrusted_workers = Json::array();
  for (const auto& d : response.distrusted()) distrusted_workers.push_back(distrusted(d));
  return text(
      {{"workers", list},
       {"distrusted", distrusted_workers},
       {"wanted", {{"threads", response.wanted().threads()}, {"workers", response.wanted().workers()}}}});
}

std::string events_json(const v1::ListEventsResponse& response) {
  Json list = Json::array();
  for (const auto& event : response.events())
    list.push_back({{"unix_ms", event.unix_ms()},
                    {"job", event.job_id()},
                    {"worker", event.worker_id()},
                    {"kind", event.kind()},
                    {"message", event.message()}});
  return text({{"events", list}});
}

std::string report_json(const v1::JobReport& report) {
  Json findings = Json::array();
  for (const v1::Finding& f : report.findings())
    findings.push_back({{"part", f.part()}, {"text", f.text()}, {"mend", f.mend()}});
  // One line a report, as they come.
  return Json({{"id", report.job_id()},
               {"name", report.name()},
               {"state", report.job_id().empty() ? "" : std::string(wire::name(report.state()))},
               {"iterations", report.iterations()},
               {"lost", report.lost()},
               {"findings", findings}})
      .dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string submitted_json(const std::string& id, bool existed, std::uint64_t uploaded_bytes) {
  return text({{"id", id}, {"existed", existed}, {"uploaded_bytes", uploaded_bytes}});
}

std::string comparison_json(const stats::ImageComparison& c, const stats::ImageDifference* d,
                            bool has_variance, bool reference_has_variance) {
  const auto rgb = [](const auto& v) { return Json{finite(v[0]), finite(v[1]), finite(v[2])}; };
  Json worst = Json::array();
  for (const auto& pixel : c.worst)
    worst.push_back({{"x", pixel.x},
                     {"y", pixel.y},
                     {"relative_squared_error", finite(pixel.relative_squared_error)},
                     {"value", rgb(pixel.a)},
                     {"reference", rgb(pixel.b)}});
  Json noise = nullptr;
  if (d != nullptr) {
    const stats::ComparisonNoise& n = d->noise;
    const auto figure = [](double value, double error) {
      constexpr double kNormal = 1.96;
      return Json{{"standard_error", finite(error)},
                  {"interval", {finite(value - kNormal * error), finite(value + kNormal * error)}}};
    };
    Json blocks = Json::array();
    for (const stats::BlockDifference& block : d->differing)
      blocks.push_back({{"x", block.x},
                        {"y", block.y},
                        {"width", block.width},
                        {"height", block.height},
                        {"p", block.p},
                        {"mean", rgb(block.a)},
                        {"mean_reference", rgb(block.b)}});
    noise = {{"variance_known", has_variance},
             {"reference_variance_known", reference_has_variance},
             {"mean", figure(c.mean_a, n.mean_a)},
             {"mean_reference", figure(c.mean_b, n.mean_b)},
             {"mean_ratio", figure(c.mean_ratio, n.mean_ratio)},
             {"rmse", figure(c.rmse, n.rmse)},
             {"relmse", figure(c.relmse, n.relmse)},
             {"expected_relmse", finite(n.expected_relmse)},
             {"blocks", d->blocks},
             {"differing_blocks", blocks}};
  }
  return text({{"mean", finite(c.mean_a)},
               {"mean_reference", finite(c.mean_b)},
               {"mean_ratio", finite(c.mean_ratio)},
               {"rmse", finite(c.rmse)},
               {"relmse", finite(c.relmse)},
               {"relmse_trimmed", finite(c.relmse_trimmed)},
               {"worst", worst},
               {"noise", noise}});
}

std::string version_json() {
  return text(
      {{"version", std::string(version())}, {"build_id", std::string(build_id())}, {"protocol", kProtocol}});
}

std::string plan_json(const std::string& integrator, const std::map<std::string, std::string>& settings,
                      const std::string& plan) {
  Json values = Json::object();
  for (const auto& [key, value] : settings) values[key] = value;
  return text({{"integrator", integrator}, {"integrator_settings", values}, {"plan", plan}});
}

}  // namespace candela::client
