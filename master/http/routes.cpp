#include "master/http/routes.h"

#include <array>

namespace candela::master {
namespace {

constexpr auto kRoutes = std::to_array<Route>({
    {"GET", "/healthz", HttpAction::health},
    {"GET", "/metrics", HttpAction::metrics},
    {"GET", "/api/farm", HttpAction::farm},
    {"GET", "/api/stream", HttpAction::stream},
    {"GET", "/api/throughput", HttpAction::throughput},
    {"GET", "/api/jobs", HttpAction::jobs},
    {"POST", "/api/jobs", HttpAction::submit},
    {"GET", "/api/jobs/{id}", HttpAction::job},
    {"GET", "/api/jobs/{id}/details", HttpAction::details},
    {"GET", "/api/jobs/{id}/name", HttpAction::name},
    {"GET", "/api/jobs/{id}/thumbnail", HttpAction::thumbnail},
    {"GET", "/api/jobs/{id}/image.exr", HttpAction::exr},
    {"GET", "/api/jobs/{id}/image.png", HttpAction::png},
    {"GET", "/api/jobs/{id}/tile", HttpAction::tile},
    {"GET", "/api/jobs/{id}/pixel", HttpAction::pixel},
    {"GET", "/api/jobs/{id}/colors", HttpAction::colors},
    {"POST", "/api/jobs/{id}/pause", HttpAction::steer_job},
    {"POST", "/api/jobs/{id}/resume", HttpAction::steer_job},
    {"POST", "/api/jobs/{id}/cancel", HttpAction::steer_job},
    {"POST", "/api/jobs/{id}/priority", HttpAction::steer_job},
    {"POST", "/api/jobs/{id}/extend", HttpAction::steer_job},
    {"GET", "/api/groups", HttpAction::groups},
    {"GET", "/api/groups/{id}", HttpAction::group},
    {"POST", "/api/groups/{id}/pause", HttpAction::steer_group},
    {"POST", "/api/groups/{id}/resume", HttpAction::steer_group},
    {"POST", "/api/groups/{id}/cancel", HttpAction::steer_group},
    {"POST", "/api/groups/{id}/priority", HttpAction::steer_group},
    {"POST", "/api/groups/{id}/extend", HttpAction::steer_group},
    {"GET", "/api/workers", HttpAction::workers},
    {"GET", "/api/workers/{id}", HttpAction::worker},
    {"POST", "/api/workers/{id}/drain", HttpAction::drain},
    {"GET", "/api/blobs/{sha256}", HttpAction::blob},
    {"PUT", "/api/blobs/{sha256}", HttpAction::upload},
    {"POST", "/api/login", HttpAction::login},
    {"POST", "/api/check", HttpAction::check},
});

// False: the path is another one. A part is not empty and has no slash.
bool path_fits(std::string_view pattern, std::string_view path, std::string_view& part) {
  const std::size_t open = pattern.find('{');
  if (open == std::string_view::npos) return pattern == path;
  const std::string_view after = pattern.substr(pattern.find('}') + 1);
  if (!path.starts_with(pattern.substr(0, open)) || path.size() <= open + after.size() ||
      !path.ends_with(after))
    return false;
  part = path.substr(open, path.size() - open - after.size());
  return part.find('/') == std::string_view::npos;
}

}  // namespace

std::span<const Route> http_routes() {
  return kRoutes;
}

RouteMatch find_route(std::string_view method, std::string_view path) {
  if (method == "HEAD") method = "GET";
  RouteMatch out;
  for (const Route& route : kRoutes) {
    std::string_view part;
    if (!path_fits(route.path, path, part)) continue;
    if (route.method == method) return {&route, std::string(part), false};
    out.other_method = true;
  }
  return out;
}

}  // namespace candela::master
