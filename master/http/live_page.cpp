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

bool wants_error(const HttpRequest& request) {
  const auto it = request.query.find("kind");
  return it != request.query.end() && it->second == "error";
}

std::string topic_of(const std::string& job_id, bool error) {
  return (error ? "error/" : "image/") + job_id;
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

std::optional<HttpAnswer> LivePage::answer(const HttpRequest& request, std::uint64_t connection) {
  if (auto refused = refusal(request)) return refused;
  const std::string& path = request.path;
  if (path.starts_with("/api/")) {
    if (path == "/api/login" && request.method == "POST") return log_in(request);
    if (request.method == "POST") return control(request, connection);
    if (!may_read(request))
      return error_answer(401,
                          "role 'read' is missing: give the page the token in the file 'token' of the "
                          "master's data folder; scripts say Authorization: Bearer TOKEN");
    return answer_api(request, connection);
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

std::optional<HttpAnswer> LivePage::answer_api(const HttpRequest& request, std::uint64_t connection) {
  const std::string_view path = std::string_view(request.path).substr(5);
  if (path == "farm")
    return json_answer(JsonObject()
                           .add("version", version())
                           .add("build_id", build_id())
                           .add("start", start_)
                           .flag("controls", !options_.token.empty())
                           .text());
  if (path == "stream") return open_stream(request);
  if (path == "jobs") return later(connection, [this, query = request.query] { return list_jobs(query); });
  if (path == "workers")
    return later(connection, [this] {
      std::vector<std::string> rows;
      for (const auto& [id, row] : worker_rows()) rows.push_back(row);
      return json_answer("{\"workers\":" + json_array(rows) + "}");
    });
  if (path == "throughput") return later(connection, [this] { return json_answer(throughput_json()); });
  const std::size_t slash = path.find('/');
  const std::string_view folder = path.substr(0, slash);
  if (slash == std::string_view::npos || (folder != "jobs" && folder != "workers"))
    return error_answer(404, "there are farm, jobs, workers, throughput and stream below /api");
  const std::string rest(path.substr(slash + 1));
  const std::string id = rest.substr(0, rest.find('/'));
  const std::string part = id.size() == rest.size() ? "" : rest.substr(id.size() + 1);
  if (folder == "workers") {
    if (!part.empty()) return error_answer(404, "a worker has no such part");
    const auto status = farm_.worker(id);
    return status ? json_answer(wire::page_json(to_message(*status))) : error_answer(404, "no such worker");
  }
  if (part == "tile") return tile(request, id);
  if (part == "pixel") return pixel(request, id);
  const bool exr = part == "image.exr", png = part == "image.png", thumb = part == "thumbnail";
  if (part != "" && part != "details" && part != "name" && !exr && !png && !thumb)
    return error_answer(404, "a job has name, details, thumbnail, image.exr, image.png, tile and pixel");
  if (part == "name") {
    const auto name = farm_.with_scheduler([&](Scheduler& s) -> std::optional<std::string> {
      const Job* job = s.job(id);
      return job == nullptr ? std::nullopt : std::optional(job->row.name);
    });
    return name ? json_answer(JsonObject().add("name", *name).text()) : error_answer(404, "no such job");
  }
  if (!farm_.with_scheduler([&](Scheduler& s) { return s.job(id) != nullptr; }))
    return error_answer(404, "no such job");
  if (thumb) return thumbnail(request, id, connection);
  if (exr || png) return download(request, id, png, connection);
  return later(connection, [this, id, part] {
    if (part == "details") return json_answer(details_of(id));
    const auto status = farm_.full_status(id);
    return status ? json_answer(wire::page_json(to_message(*status))) : error_answer(404, "no such job");
  });
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
    topic = topic_of(job, wants_error(request));
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
  std::shared_ptr<Picture> picture;
  {
    const Lock lock(mutex_);
    const auto it = topics_.find(topic_of(job_id, wants_error(request)));
    if (it != topics_.end()) picture = it->second.picture_made;
  }
  if (!picture) return error_answer(404, "there is no picture: open the job's stream first");
  Picture::Tile tile = picture->tile(*level, *x, *y);
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
  const Lock lock(mutex_);
  const auto it = topics_.find(topic_of(job_id, wants_error(request)));
  if (it == topics_.end() || !it->second.picture_made)
    return error_answer(404, "there is no picture: open the job's stream first");
  const Picture::Level& level = it->second.picture_made->levels().front();
  if (*x >= level.width || *y >= level.height) return error_answer(404, "there is no such pixel");
  const float* rgb = &level.rgb[3 * (std::size_t{*y} * level.width + *x)];
  return json_answer(JsonObject()
                         .count("iterations", it->second.picture_made->iterations())
                         .add("r", double{rgb[0]})
                         .add("g", double{rgb[1]})
                         .add("b", double{rgb[2]})
                         .text());
}

std::optional<HttpAnswer> LivePage::control(const HttpRequest& request, std::uint64_t connection) {
  if (options_.token.empty())
    return error_answer(403, "this page is read-only: the master has no --page-token-file");
  const std::string_view given = request.field("authorization");
  if (!given.starts_with("Bearer ")) return error_answer(401, "say Authorization: Bearer TOKEN");
  if (!wire::same_token(given.substr(7), options_.token)) return error_answer(403, "this is not the token");
  if (request.path == "/api/check") return json_answer("{}");
  // /api/jobs/ID/VERB, /api/workers/ID/drain
  const std::string_view path = std::string_view(request.path).substr(5);
  const std::size_t first = path.find('/'), last = path.rfind('/');
  if (first == std::string_view::npos || first == last) return error_answer(404, "there is no such control");
  const std::string_view folder = path.substr(0, first);
  const std::string id(path.substr(first + 1, last - first - 1)), verb(path.substr(last + 1));
  if (folder == "workers" && verb == "drain") {
    if (!farm_.worker(id)) return error_answer(404, "no such worker");
    const auto drained = farm_.with_scheduler([&](Scheduler& s) { return s.drain(id, farm_.now()); });
    if (!drained.ok()) return error_answer(409, drained.error().to_string());
    return json_answer("{}");
  }
  if (folder != "jobs") return error_answer(404, "there is no such control");
  if (!farm_.with_scheduler([&](Scheduler& s) { return s.job(id) != nullptr; }))
    return error_answer(404, "no such job");
  return later(connection, [this, id, verb, query = request.query] { return change(id, verb, query); });
}

HttpAnswer LivePage::change(const std::string& id, const std::string& verb,
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
  Result<JobStatus> status = usage_error("there is no such control");
  if (verb == "pause")
    status = farm_.change_job(id, [&](Scheduler& s, Now t) { return s.pause(id, t); });
  else if (verb == "resume")
    status = farm_.resume(id);
  else if (verb == "cancel")
    status = farm_.change_job(id, [&](Scheduler& s, Now t) { return s.cancel(id, t); });
  else if (verb == "priority") {
    const auto priority = number("priority");
    if (!priority || std::abs(*priority) > 1e9 || *priority != std::floor(*priority) ||
        !values.contains("priority"))
      return error_answer(400, "priority must be an integer");
    status = farm_.change_job(
        id, [&](Scheduler& s, Now t) { return s.set_priority(id, static_cast<std::int32_t>(*priority), t); });
  } else if (verb == "extend") {
    const auto iterations = number("iterations"), seconds = number("seconds"), relmse = number("relmse");
    if (!iterations || !seconds || !relmse || *iterations < 0 || *iterations > 1e15 ||
        *iterations != std::floor(*iterations))
      return error_answer(400, "iterations must be an integer, seconds and relmse numbers, 0 or more");
    status = farm_.extend(id, {static_cast<std::uint64_t>(*iterations), *seconds, *relmse});
  } else {
    return error_answer(404, "there is no such control");
  }
  if (status.ok()) return json_answer(wire::page_json(to_message(*status)));
  const ErrorKind kind = status.error().kind;
  return error_answer(kind == ErrorKind::input || kind == ErrorKind::usage ? 400
                      : kind == ErrorKind::refused                         ? 409
                                                                           : 503,
                      status.error().to_string());
}

}  // namespace candela::master
