#include "master/http/routes.h"

#include <array>

namespace candela::master {
namespace {

constexpr auto kRoutes = std::to_array<Route>({
    {"GET", "/healthz", Action::health},
    {"GET", "/metrics", Action::metrics},
    {"GET", "/api/farm", Action::farm},
    {"GET", "/api/stream", Action::stream},
    {"GET", "/api/throughput", Action::throughput},
    {"GET", "/api/jobs", Action::jobs},
    {"POST", "/api/jobs", Action::submit},
    {"GET", "/api/jobs/{id}", Action::job},
    {"GET", "/api/jobs/{id}/details", Action::details},
    {"GET", "/api/jobs/{id}/name", Action::name},
    {"GET", "/api/jobs/{id}/thumbnail", Action::thumbnail},
    {"GET", "/api/jobs/{id}/image.exr", Action::exr},
    {"GET", "/api/jobs/{id}/image.png", Action::png},
    {"GET", "/api/jobs/{id}/tile", Action::tile},
    {"GET", "/api/jobs/{id}/pixel", Action::pixel},
    {"POST", "/api/jobs/{id}/pause", Action::steer_job},
    {"POST", "/api/jobs/{id}/resume", Action::steer_job},
    {"POST", "/api/jobs/{id}/cancel", Action::steer_job},
    {"POST", "/api/jobs/{id}/priority", Action::steer_job},
    {"POST", "/api/jobs/{id}/extend", Action::steer_job},
    {"GET", "/api/groups", Action::groups},
    {"GET", "/api/groups/{id}", Action::group},
    {"POST", "/api/groups/{id}/pause", Action::steer_group},
    {"POST", "/api/groups/{id}/resume", Action::steer_group},
    {"POST", "/api/groups/{id}/cancel", Action::steer_group},
    {"POST", "/api/groups/{id}/priority", Action::steer_group},
    {"POST", "/api/groups/{id}/extend", Action::steer_group},
    {"GET", "/api/workers", Action::workers},
    {"GET", "/api/workers/{id}", Action::worker},
    {"POST", "/api/workers/{id}/drain", Action::drain},
    {"GET", "/api/blobs/{sha256}", Action::blob},
    {"PUT", "/api/blobs/{sha256}", Action::upload},
    {"POST", "/api/login", Action::login},
    {"POST", "/api/check", Action::check},
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
