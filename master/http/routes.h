// All answers of the server in one table: docs/openapi.json describes the same, and a test compares both.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace candela::master {

enum class HttpAction : std::uint8_t {
  health,
  metrics,
  farm,
  stream,
  throughput,
  jobs,
  submit,
  job,
  details,
  name,
  thumbnail,
  exr,
  png,
  tile,
  pixel,
  colors,
  groups,
  group,
  workers,
  worker,
  blob,
  upload,
  login,
  check,
  drain,
  steer_job,
  steer_group,
};

// `path` may have one {part}; `path` of steering ends in what is to be done.
struct Route {
  std::string_view method, path;
  HttpAction action;
};
std::span<const Route> http_routes();

struct RouteMatch {
  const Route* route = nullptr;  // null: there is none
  std::string part;              // what stands for {part}
  bool other_method = false;     // there is one for another method
  std::string_view verb() const { return route->path.substr(route->path.rfind('/') + 1); }
};
// HEAD finds what GET does.
RouteMatch find_route(std::string_view method, std::string_view path);

}  // namespace candela::master
