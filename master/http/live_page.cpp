// The routes of the page. docs/page.md has them for users.
#include "master/http/live_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "common/base/hash.h"
#include "common/base/version.h"
#include "common/wire/json.h"
#include "common/wire/token.h"
#include "master/api/messages.h"
#include "master/farm.h"
#include "master/http/page_files.h"
#include "master/http/page_json.h"

namespace candela::master {
namespace {

constexpr std::size_t kMaxTasks = 64;
constexpr std::size_t kMaxTopics = 64;
constexpr std::uint64_t kPictureMemoryShare = 16;  // of the memory for jobs: pictures

HttpAnswer json_answer(std::string text) {
  return {.type = "application/json", .body = std::move(text) + "\n"};
}

HttpAnswer file_answer(std::string_view name) {
  for (const PageFile& file : page_files()) {
    if (file.name != name) continue;
    const std::string_view ending = name.substr(name.rfind('.') + 1);
    return {.type = ending == "html"  ? "text/html; charset=utf-8"
                    : ending == "css" ? "text/css; charset=utf-8"
                    : ending == "svg" ? "image/svg+xml"
                                      : "text/javascript; charset=utf-8",
            .body = std::string(file.bytes),
            .etag = std::string(file.etag)};
  }
  return error_answer(404, "there is no such page: begin at /");
}

// A Host field that names this machine for itself. A page of another site cannot send one, even where its
// name has been made to lead here.
bool names_loopback(std::string_view host) {
  if (host.starts_with('[')) return host.substr(0, host.find(']') + 1) == "[::1]";
  host = host.substr(0, host.find(':'));
  const bool numeric = host.find_first_not_of("0123456789.") == std::string_view::npos;
  return host == "localhost" || (numeric && host.starts_with("127."));
}

std::optional<std::uint32_t> number_of(const std::map<std::string, std::string>& query,
                                       const std::string& name) {
  const auto it = query.find(name);
  if (it == query.end()) return std::nullopt;
  std::uint32_t value = 0;
  const char* end = it->second.data() + it->second.size();
  const auto [at, error] = std::from_chars(it->second.data(), end, value);
  if (error != std::errc() || at != end) return std::nullopt;
  return value;
}

HttpAnswer no_route(const RouteMatch& match) {
  if (!match.other_method) return error_answer(404, "there is no such address: docs/openapi.json has them");
  HttpAnswer out = error_answer(405, "this address has another method: docs/openapi.json has it");
  out.allow = "GET, HEAD, POST, PUT";
  return out;
}

}  // namespace

Result<std::string> read_page_token(const std::string& file) {
  auto token = wire::read_token_file(file);
  if (!token.ok()) {
    Error error = std::move(token).error();
    error.kind = ErrorKind::usage;
    return std::move(error).with_field("--page-token-file");
  }
  return token;
}

LivePage::LivePage(Farm& farm, PageOptions options, Out out)
    : farm_(farm),
      options_(std::move(options)),
      out_(std::move(out)),
      cookie_name_("candela-" + sha256_hex("name of " + options_.read_token).substr(0, 12)),
      cookie_value_(sha256_hex("cookie of " + options_.read_token)),
      start_(random_id("m", 10)),
      picture_memory_(farm.memory_limit() / kPictureMemoryShare) {
  thread_ = std::thread([this] { run(); });
  save_thread_ = std::thread([this] { run_saves(); });
}

LivePage::~LivePage() {
  {
    const Lock lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  save_wake_.notify_all();
  thread_.join();
  save_thread_.join();
}

std::optional<HttpAnswer> LivePage::answer(const HttpRequest& request, const RouteMatch& match,
                                           std::uint64_t connection) {
  if (auto refused = refusal(request)) return refused;
  const std::string& path = request.path;
  if (path.starts_with("/api/")) {
    if (match.route != nullptr && match.route->action == HttpAction::login) return log_in(request);
    if (request.method == "POST") return control(request, match, connection);
    if (!may_read(request))
      return error_answer(401,
                          "role 'read' is missing: give the page the token in the file 'token' of the "
                          "master's data folder; scripts say Authorization: Bearer TOKEN");
    return answer_api(request, match, connection);
  }
  if (request.method == "POST") return error_answer(405, "only GET and HEAD");
  const bool shell =
      path == "/" || path == "/workers" || path.starts_with("/jobs/") || path.starts_with("/workers/");
  HttpAnswer file = file_answer(shell ? "index.html" : std::string_view(path).substr(1));
  if (file.code == 200 && request.field("if-none-match") == fmt::format("\"{}\"", file.etag)) {
    file.code = 304;
    file.body.clear();
  }
  return file;
}

bool LivePage::is_token(std::string_view given) const {
  const bool reads = wire::same_token(given, options_.read_token);
  return (wire::same_token(given, options_.token) && !options_.token.empty()) || reads;
}

bool LivePage::may_read(const HttpRequest& request) const {
  const std::string_view given = request.field("authorization");
  if (given.starts_with("Bearer ")) return is_token(given.substr(7));
  // "a=1; candela-...=..."
  const std::string_view cookies = request.field("cookie");
  const std::string name = cookie_name_ + "=";
  for (std::size_t at = 0; at < cookies.size();) {
    const std::size_t end = std::min(cookies.find(';', at), cookies.size());
    std::string_view one = cookies.substr(at, end - at);
    while (one.starts_with(' ')) one.remove_prefix(1);
    if (one.starts_with(name)) return wire::same_token(one.substr(name.size()), cookie_value_);
    at = end + 1;
  }
  return false;
}

HttpAnswer LivePage::log_in(const HttpRequest& request) const {
  const std::string_view given = request.field("authorization");
  if (!given.starts_with("Bearer ")) return error_answer(401, "say Authorization: Bearer TOKEN");
  if (!is_token(given.substr(7))) return error_answer(403, "this is not the token");
  HttpAnswer answer = json_answer("{}");
  answer.cookie = fmt::format("{}={}; Path=/; HttpOnly; SameSite=Strict", cookie_name_, cookie_value_);
  return answer;
}

std::optional<HttpAnswer> LivePage::refusal(const HttpRequest& request) const {
  if (options_.loopback && !names_loopback(request.field("host")))
    return error_answer(421, "ask for localhost or 127.0.0.1: this master serves its own machine alone");
  const std::string_view site = request.field("sec-fetch-site");
  if (request.path.starts_with("/api/") && (site == "cross-site" || site == "same-site"))
    return error_answer(403, "pages of other sites get nothing");
  return std::nullopt;
}

std::optional<HttpAnswer> LivePage::later(std::uint64_t connection, std::function<HttpAnswer()> make) {
  {
    const Lock lock(mutex_);
    if (tasks_.size() >= kMaxTasks) return error_answer(503, "too many requests at a time");
    tasks_.push_back([this, connection, make = std::move(make)] {
      HttpAnswer made;
      try {
        made = make();
      } catch (const std::bad_alloc&) {
        made = error_answer(503, "the master is out of memory: ask again in a moment");
      }
      out_.answer(connection, std::move(made));
    });
  }
  wake_.notify_all();
  return std::nullopt;
}

std::optional<HttpAnswer> LivePage::answer_api(const HttpRequest& request, const RouteMatch& match,
                                               std::uint64_t connection) {
  if (match.route == nullptr) return no_route(match);
  const std::string& id = match.part;
  const auto job_is_there = [&] {
    return farm_.with_scheduler([&](Scheduler& s) { return s.job(id) != nullptr; });
  };
  const auto no_job = [] { return error_answer(404, "no such job"); };
  const HttpAction action = match.route->action;
  switch (action) {
    case HttpAction::farm:
      return json_answer(JsonObject()
                             .add("version", version())
                             .add("build_id", build_id())
                             .add("start", start_)
                             .flag("controls", !options_.token.empty())
                             .text());
    case HttpAction::stream:
      return open_stream(request);
    case HttpAction::jobs:
      return later(connection, [this, query = request.query] { return list_jobs(query); });
    case HttpAction::workers:
      return later(connection, [this] {
        std::vector<std::string> rows;
        for (const auto& [worker, row] : worker_rows()) rows.push_back(row);
        return json_answer("{\"workers\":" + json_array(rows) + "}");
      });
    case HttpAction::worker: {
      const auto status = farm_.worker(id);
      return status ? json_answer(wire::page_json(to_message(*status))) : error_answer(404, "no such worker");
    }
    case HttpAction::throughput:
      return later(connection, [this] { return json_answer(throughput_json()); });
    case HttpAction::groups:
      return later(connection, [this] { return list_groups(); });
    case HttpAction::group: {
      const auto status = farm_.group_status(id);
      return status ? json_answer(wire::page_json(to_message(*status))) : error_answer(404, "no such group");
    }
    case HttpAction::blob: {
      if (!is_sha256_hex(id)) return error_answer(400, "a blob is named by 64 lower-case hex digits");
      farm_.blobs().use(id);
      const auto size = farm_.blobs().size(id);
      return size ? json_answer(JsonObject().add("sha256", id).count("size_bytes", *size).text())
                  : error_answer(404, "no such blob");
    }
    case HttpAction::tile:
      return tile(request, id);
    case HttpAction::pixel:
      return pixel(request, id);
    case HttpAction::colors:
      return colors(request, id, connection);
    case HttpAction::name: {
      const auto name = farm_.with_scheduler([&](Scheduler& s) -> std::optional<std::string> {
        const Job* job = s.job(id);
        return job == nullptr ? std::nullopt : std::optional(job->row.name);
      });
      return name ? json_answer(JsonObject().add("name", *name).text()) : no_job();
    }
    case HttpAction::thumbnail:
      return job_is_there() ? thumbnail(request, id, connection) : no_job();
    case HttpAction::exr:
    case HttpAction::png:
      return job_is_there() ? download(request, id, action == HttpAction::png, connection) : no_job();
    case HttpAction::details:
      if (!job_is_there()) return no_job();
      return later(connection, [this, id] { return json_answer(details_of(id)); });
    case HttpAction::job:
      return later(connection, [this, id] {
        const auto status = farm_.full_status(id);
        return status ? json_answer(wire::page_json(to_message(*status))) : error_answer(404, "no such job");
      });
    default:
      return no_route(match);
  }
}

HttpAnswer LivePage::open_stream(const HttpRequest& request) {
  std::string topic = "farm";
  const auto value = [&](const char* name) {
    const auto it = request.query.find(name);
    return it == request.query.end() ? std::string() : it->second;
  };
  if (const std::string job = value("job"); !job.empty()) {
    if (!farm_.with_scheduler([&](Scheduler& s) { return s.job(job) != nullptr; }))
      return error_answer(404, "no such job");
    const auto kind = kind_of(request);
    if (!kind.ok()) return error_of(kind.error());
    topic = topic_of(job, *kind);
  } else if (const std::string worker = value("worker"); !worker.empty()) {
    if (!farm_.with_scheduler([&](Scheduler& s) { return s.workers().contains(worker); }))
      return error_answer(404, "no such worker");
    topic = "worker/" + worker;
  }
  HttpAnswer out{.type = "text/event-stream", .topic = topic};
  out.body = fmt::format("retry: 2000\nevent: hello\ndata: {}\n\n", JsonObject().add("start", start_).text());
  const Lock lock(mutex_);
  const auto it = topics_.find(topic);
  if (it == topics_.end() && topics_.size() >= kMaxTopics) return error_answer(503, "too many streams");
  if (it != topics_.end())
    for (const auto& [kind, data] : it->second.sent)
      out.body += fmt::format("event: {}\ndata: {}\n\n", kind, data);
  return out;
}

HttpAnswer LivePage::tile(const HttpRequest& request, const std::string& job_id) {
  const auto level = number_of(request.query, "level"), x = number_of(request.query, "x"),
             y = number_of(request.query, "y");
  if (!level || !x || !y) return error_answer(400, "a tile has level, x and y");
  const auto form = request.query.find("form");
  const bool half = form != request.query.end() && form->second == "half";
  if (!half && form != request.query.end() && form->second != "rgbe")
    return error_answer(400, "form is rgbe or half");
  HttpAnswer otherwise;
  const std::shared_ptr<Picture> picture = shown_picture(request, job_id, otherwise);
  if (!picture) return otherwise;
  Picture::Tile tile = picture->tile(*level, *x, *y, half ? TileForm::half : TileForm::rgbe);
  if (!tile.bytes) return error_answer(404, "there is no such tile");
  HttpAnswer out{.type = "application/octet-stream", .shared = tile.bytes, .etag = tile.etag};
  if (request.field("if-none-match") == fmt::format("\"{}\"", tile.etag)) {
    out.code = 304;
    out.shared = nullptr;
  }
  return out;
}

HttpAnswer LivePage::pixel(const HttpRequest& request, const std::string& job_id) {
  const auto x = number_of(request.query, "x"), y = number_of(request.query, "y");
  if (!x || !y) return error_answer(400, "a pixel has x and y");
  HttpAnswer otherwise;
  const std::shared_ptr<Picture> picture = shown_picture(request, job_id, otherwise);
  if (!picture) return otherwise;
  const Picture::Level& level = picture->levels().front();
  if (level.rgb.empty()) return error_answer(404, "a mix has no values: its tiles have those of its layers");
  if (*x >= level.width || *y >= level.height) return error_answer(404, "there is no such pixel");
  const float* rgb = &level.rgb[3 * (std::size_t{*y} * level.width + *x)];
  return json_answer(JsonObject()
                         .count("iterations", picture->iterations())
                         .add("r", double{rgb[0]})
                         .add("g", double{rgb[1]})
                         .add("b", double{rgb[2]})
                         .text());
}

std::optional<HttpAnswer> LivePage::may_not_change(const HttpRequest& request) const {
  if (options_.token.empty())
    return error_answer(403, "this page is read-only: the master has no --page-token-file");
  const std::string_view given = request.field("authorization");
  if (!given.starts_with("Bearer ")) return error_answer(401, "say Authorization: Bearer TOKEN");
  if (!wire::same_token(given.substr(7), options_.token)) return error_answer(403, "this is not the token");
  return std::nullopt;
}

std::optional<HttpAnswer> LivePage::control(const HttpRequest& request, const RouteMatch& match,
                                            std::uint64_t connection) {
  if (auto refused = may_not_change(request)) return refused;
  if (match.route == nullptr) return no_route(match);
  const std::string& id = match.part;
  switch (match.route->action) {
    case HttpAction::check:
      return json_answer("{}");
    case HttpAction::submit:
      return later(connection, [this, json = request.body] { return submit(json); });
    case HttpAction::drain: {
      if (!farm_.worker(id)) return error_answer(404, "no such worker");
      const auto drained = farm_.with_scheduler([&](Scheduler& s) { return s.drain(id, farm_.now()); });
      if (!drained.ok()) return error_answer(409, drained.error().to_string());
      return json_answer("{}");
    }
    case HttpAction::steer_job:
    case HttpAction::steer_group: {
      const bool group = match.route->action == HttpAction::steer_group;
      if (!farm_.with_scheduler(
              [&](Scheduler& s) { return group ? s.groups().contains(id) : s.job(id) != nullptr; }))
        return error_answer(404, group ? "no such group" : "no such job");
      return later(connection, [this, id, group, verb = match.verb(), query = request.query] {
        return change(id, verb, group, query);
      });
    }
    default:
      return no_route(match);
  }
}

namespace {

template <class Status>
HttpAnswer answer_of(const Result<Status>& status) {
  return status.ok() ? json_answer(wire::page_json(to_message(*status))) : error_of(status.error());
}

}  // namespace

HttpAnswer LivePage::change(const std::string& id, std::string_view verb, bool group,
                            const std::map<std::string, std::string>& values) {
  if (farm_.stopping()) return error_answer(503, "the master is stopping");
  // Nothing for a value that is no number; 0 where there is none.
  const auto number = [&](const char* name) -> std::optional<double> {
    const auto it = values.find(name);
    if (it == values.end() || it->second.empty()) return 0;
    double value = 0;
    const char* end = it->second.data() + it->second.size();
    const auto [at, error] = std::from_chars(it->second.data(), end, value);
    if (error != std::errc() || at != end || !std::isfinite(value)) return std::nullopt;
    return value;
  };
  using Kind = GroupAction::Kind;
  GroupAction action;
  if (verb == "priority") {
    const auto priority = number("priority");
    if (!priority || std::abs(*priority) > 1e9 || *priority != std::floor(*priority) ||
        !values.contains("priority"))
      return error_answer(400, "priority must be an integer");
    action = {Kind::priority, static_cast<std::int32_t>(*priority), {}};
  } else if (verb == "extend") {
    const auto iterations = number("iterations"), seconds = number("seconds"), relmse = number("relmse");
    if (!iterations || !seconds || !relmse || *iterations < 0 || *iterations > 1e15 ||
        *iterations != std::floor(*iterations))
      return error_answer(400, "iterations must be an integer, seconds and relmse numbers, 0 or more");
    action = {Kind::extend, 0, {static_cast<std::uint64_t>(*iterations), *seconds, *relmse}};
  } else {
    action.kind = verb == "pause" ? Kind::pause : verb == "resume" ? Kind::resume : Kind::cancel;
  }
  if (group) return answer_of(farm_.steer_group(id, action));
  switch (action.kind) {
    case Kind::pause:
      return answer_of(farm_.change_job(id, [&](Scheduler& s, Now t) { return s.pause(id, t); }));
    case Kind::resume:
      return answer_of(farm_.resume(id));
    case Kind::cancel:
      return answer_of(farm_.change_job(id, [&](Scheduler& s, Now t) { return s.cancel(id, t); }));
    case Kind::priority:
      return answer_of(
          farm_.change_job(id, [&](Scheduler& s, Now t) { return s.set_priority(id, action.priority, t); }));
    case Kind::extend:
      break;
  }
  return answer_of(farm_.extend(id, action.extension));
}

}  // namespace candela::master
