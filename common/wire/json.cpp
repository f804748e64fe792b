#include "common/wire/json.h"

#include <fmt/format.h>
#include <google/protobuf/util/json_util.h>

#include <map>
#include <sstream>

#include "common/base/text.h"
#include "common/wire/job_figures.h"
#include "common/wire/json_values.h"
#include "common/wire/wire.h"

namespace candela::wire {
namespace {

Json limit(double value) {
  return value > 0 ? Json(value) : Json(nullptr);
}
Json time_ms(std::int64_t value) {
  return value > 0 ? Json(value) : Json(nullptr);
}

Json map(const google::protobuf::Map<std::string, std::string>& values) {
  // Protobuf's maps have no order; ours do.
  return std::map<std::string, std::string>(values.begin(), values.end());
}

// Every cause by its name, those that never came included.
Json failures(const google::protobuf::RepeatedPtrField<v1::FailureCount>& counts) {
  Json json;
  for (const FailureCause cause : kAllFailureCauses) json[std::string(name(cause))] = 0;
  for (const auto& f : counts) json[std::string(name(from_proto(f.cause())))] = f.count();
  return json;
}

Json texts(const google::protobuf::RepeatedPtrField<std::string>& values) {
  Json json = Json::array();
  for (const std::string& value : values) json.push_back(value);
  return json;
}

Json chains(const v1::ChainStatus& c) {
  Json json;
  json["chains"] = c.plan().chains();
  json["segment_mutations"] = c.plan().segment_mutations();
  json["bootstrap_samples"] = c.plan().bootstrap_samples();
  json["bootstrap_done"] = c.bootstrap_done();
  const bool has_chains = c.has_plan();  // or mutations within iterations, without b
  json["b"] = has_chains ? finite(c.b()) : Json();
  json["b_standard_error"] = has_chains ? finite(c.b_standard_error()) : Json();
  json["b_samples"] = c.b_samples();
  json["groups"] = Json::array();
  for (const v1::ChainGroupStatus& g : c.groups())
    if (has_chains)
      json["groups"].push_back({{"mutations", g.mutations()},
                                {"accepted", g.accepted()},
                                {"large_steps", g.large_steps()},
                                {"large_accepted", g.large_accepted()},
                                {"longest_stay", g.longest_stay()},
                                {"stay_pixel", {finite(g.stay_x()), finite(g.stay_y())}}});
  // The sums of all groups; absent if the integrator does not mutate paths.
  for (const v1::ChainGroupStatus& g : c.groups())
    for (const v1::MutationStatus& m : g.by_mutation()) {
      Json& sum = json["by_mutation"][m.name()];
      const auto add = [](Json& to, std::uint64_t count) {
        to = (to.is_null() ? std::uint64_t{0} : to.get<std::uint64_t>()) + count;
      };
      add(sum["proposed"], m.proposed());
      add(sum["accepted"], m.accepted());
      for (const auto& [cause, count] : m.failed()) add(sum["failed"][cause], count);
      add(sum["rays"], m.rays());
    }
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

Json crop(const v1::Crop& c) {
  return {{"x", c.x()}, {"y", c.y()}, {"whole_width", c.whole_width()}, {"whole_height", c.whole_height()}};
}

Json settings(const v1::JobSettings& s) {
  return {{"integrator", s.integrator()},
          {"integrator_settings", map(s.integrator_settings())},
          {"width", s.width()},
          {"height", s.height()},
          {"crop", s.has_crop() ? crop(s.crop()) : Json(nullptr)},
          {"filter", s.filter()},
          {"filter_settings", map(s.filter_settings())},
          {"sampler", s.sampler()},
          {"seed", s.seed()},
          {"isa", s.isa()},
          {"aovs", s.aovs()},
          {"layers", s.layers()},
          {"edits", s.edits()}};
}

Json ranges(const google::protobuf::RepeatedPtrField<v1::IndexRange>& ranges) {
  Json json = Json::array();
  for (const v1::IndexRange& range : ranges) json.push_back({{"begin", range.begin()}, {"end", range.end()}});
  return json;
}

Json job(const v1::JobStatus& s) {
  Json json;
  const std::string indices = indices_text(s);
  json["id"] = s.id();
  json["short_id"] = s.short_id();
  json["name"] = s.name();
  json["submitter"] = s.submitter();
  json["state"] = std::string(name(s.state()));
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
  const std::uint64_t asked = iterations_asked(s);
  json["iterations_asked"] = asked > 0 ? Json(asked) : Json(nullptr);
  json["stop"] = {{"iterations", s.stop().iterations() > 0 ? Json(s.stop().iterations()) : Json(nullptr)},
                  {"time_seconds", limit(s.stop().time_seconds())},
                  {"relmse", limit(s.stop().relmse())},
                  {"indices", indices.empty() ? Json(nullptr) : Json(indices)}};
  json["settings"] = settings(s.settings());
  json["bundle_sha256"] = s.bundle_sha256();
  json["scene_path"] = s.scene_path();
  json["film_scale_log2"] = s.has_named_state() ? Json(s.named_state().film_scale_log2()) : Json(nullptr);
  json["failures"] = failures(s.failures());
  json["waiting"] = nullptr;
  if (s.has_waiting())
    json["waiting"] = {{"cause", std::string(name(from_proto(s.waiting().cause())))},
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
      s.chains().has_plan() && s.has_named_state() ? finite(s.named_state().bootstrap_b()) : Json(nullptr);
  json["chains"] = s.has_chains() ? chains(s.chains()) : Json(nullptr);
  json["epochs"] = s.has_epochs() ? epochs(s.epochs()) : Json(nullptr);
  json["layers"] = Json::array();
  for (const std::string& layer : s.layers()) json["layers"].push_back(layer);
  json["worker_memory_bytes"] = s.worker_memory_bytes();
  json["workers"] = s.workers();
  json["group"] = nullptr;
  if (s.has_frame())
    json["group"] = {{"id", s.frame().group_id()},
                     {"name", s.frame().group_name()},
                     {"frame", s.frame().frame()},
                     {"frames", s.frame().frames()}};
  json["depends"] = texts(s.depends());
  json["taints"] = Json::array();
  for (const v1::Taint& taint : s.taints())
    json["taints"].push_back({{"worker", taint.worker()},
                              {"since_unix_ms", time_ms(taint.since_unix_ms())},
                              {"units", taint.units()}});
  json["plan"] = s.plan();
  return json;
}

// Every state by its name, those without jobs included.
Json group(const v1::GroupStatus& s) {
  Json json, states;
  for (const v1::JobState state : {v1::JOB_STATE_QUEUED, v1::JOB_STATE_RUNNING, v1::JOB_STATE_PAUSED,
                                   v1::JOB_STATE_DONE, v1::JOB_STATE_FAILED, v1::JOB_STATE_CANCELLED})
    states[std::string(name(state))] = 0;
  for (const v1::StateCount& count : s.states()) states[std::string(name(count.state()))] = count.jobs();
  json["id"] = s.id();
  json["short_id"] = s.short_id();
  json["name"] = s.name();
  json["submitter"] = s.submitter();
  json["state"] = std::string(name(s.state()));
  json["message"] = s.message();
  json["priority"] = s.priority();
  json["share"] = finite(s.share());
  json["frames"] = s.frames();
  json["frames_submitted"] = s.frames_submitted();
  json["states"] = states;
  json["first_frame"] = s.first_frame();
  json["last_frame"] = s.last_frame();
  json["fraction_done"] = finite(s.fraction_done());
  json["worker_seconds"] = finite(s.worker_seconds());
  json["eta_seconds"] = finite(s.eta_seconds());
  json["workers"] = s.workers();
  json["submitted_unix_ms"] = time_ms(s.submitted_unix_ms());
  json["finished_unix_ms"] = time_ms(s.finished_unix_ms());
  json["depends"] = texts(s.depends());
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
  json["work"] = Json::array();
  for (const v1::JobName& work : w.work())
    json["work"].push_back({{"id", work.id()},
                            {"short_id", work.short_id()},
                            {"name", work.name()},
                            {"submitter", work.submitter()}});
  json["last_seen_unix_ms"] = time_ms(w.last_seen_unix_ms());
  json["build_id"] = w.build_id();
  return json;
}

// Every text of `json` is one printable line.
Json printable(const Json& json) {
  if (json.is_string()) return escape_unprintable(json.get_ref<const std::string&>());
  if (!json.is_structured()) return json;
  Json out = json.is_array() ? Json::array() : Json::object();
  for (const auto& [key, value] : json.items())
    if (json.is_array())
      out.push_back(printable(value));
    else
      out[escape_unprintable(key)] = printable(value);
  return out;
}

// No text ends a script element or begins a comment, wherever somebody may paste it.
std::string page_text(const Json& json) {
  std::string out;
  for (const char c : json.dump())
    if (c == '<')
      out += "\\u003c";
    else
      out += c;
  return out;
}

}  // namespace

std::string trust_json(const v1::TrustResponse& response) {
  return json_text(distrusted(response.worker()));
}

std::string job_json(const v1::JobStatus& status) {
  return json_text(job(status));
}

std::string group_json(const v1::GroupStatus& status) {
  return json_text(group(status));
}

std::string jobs_json(const v1::ListJobsResponse& response) {
  Json list = Json::array(), groups = Json::array();
  for (const auto& status : response.jobs()) list.push_back(job(status));
  for (const auto& status : response.groups()) groups.push_back(group(status));
  const std::string& next = response.next_page_token();
  return json_text({{"jobs", list},
                    {"groups", groups},
                    {"total", response.total()},
                    {"next", next.empty() ? Json() : Json(next)}});
}

std::string worker_json(const v1::WorkerStatus& status) {
  return json_text(worker(status));
}

std::string workers_json(const v1::ListWorkersResponse& response) {
  Json list = Json::array();
  for (const auto& status : response.workers()) list.push_back(worker(status));
  Json distrusted_workers = Json::array();
  for (const auto& d : response.distrusted()) distrusted_workers.push_back(distrusted(d));
  return json_text(
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
  return json_text({{"events", list}});
}

std::string report_json(const v1::JobReport& report) {
  Json findings = Json::array();
  for (const v1::Finding& f : report.findings())
    findings.push_back({{"part", f.part()}, {"text", f.text()}, {"mend", f.mend()}});
  // One line a report, as they come.
  return Json({{"id", report.job_id()},
               {"name", report.name()},
               {"state", report.job_id().empty() ? "" : std::string(name(report.state()))},
               {"iterations", report.iterations()},
               {"lost", report.lost()},
               {"findings", findings}})
      .dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string submission_json(const v1::SubmitRequest& request) {
  Json files = Json::array();
  for (const v1::BundleFile& file : request.bundle().files())
    files.push_back({{"path", file.path()}, {"sha256", file.sha256()}, {"size_bytes", file.size_bytes()}});
  Json stop;
  const v1::StopRule& rule = request.stop();
  stop["iterations"] = rule.iterations() > 0 ? Json(rule.iterations()) : Json(nullptr);
  stop["time_seconds"] = limit(rule.time_seconds());
  stop["relmse"] = limit(rule.relmse());
  if (rule.indices_a_size() + rule.indices_b_size() > 0) {
    stop["indices_a"] = ranges(rule.indices_a());
    stop["indices_b"] = ranges(rule.indices_b());
  }
  return json_text({{"name", request.name()},
                    {"bundle",
                     {{"main_path", request.bundle().main_path()},
                      {"files", files},
                      {"parameters", map(request.bundle().parameters())}}},
                    {"settings", settings(request.settings())},
                    {"stop", stop},
                    {"priority", request.priority()},
                    {"share", finite(request.share())},
                    {"submitter", request.submitter()},
                    {"scene_path", request.scene_path()},
                    {"depends", texts(request.depends())},
                    {"idempotency_token", request.idempotency_token()}});
}

Result<v1::SubmitRequest> parse_submission(const std::string& json) {
  v1::SubmitRequest request;
  const auto parsed = google::protobuf::util::JsonStringToMessage(json, &request);
  if (parsed.ok()) return request;
  return input_error(fmt::format("this is no submission: {}",
                                 escape_unprintable(std::string(parsed.message()).substr(0, 400))))
      .with_mend("docs/openapi.json describes it; `candela submit --export` writes one");
}

std::string page_json(const v1::JobStatus& status) {
  Json json = printable(job(status));
  std::string plan;
  std::istringstream lines(status.plan());
  for (std::string line; std::getline(lines, line);) plan += escape_unprintable(line) + '\n';
  json["plan"] = plan;
  return page_text(json);
}

std::string page_json(const v1::WorkerStatus& status) {
  return page_text(printable(worker(status)));
}

std::string page_json(const v1::GroupStatus& status) {
  return page_text(printable(group(status)));
}

}  // namespace candela::wire
