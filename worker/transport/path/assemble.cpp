#include "worker/transport/path/assemble.h"

#include <algorithm>
#include <utility>

#include "worker/scene/emitters/lights.h"
#include "worker/scene/points/surface_points.h"

namespace candela::transport::path {
namespace {

Vec3d place_of(const scene::Scene& scene, const PathVertex& v, const FoundSurface* found) {
  if (found != nullptr) return found->place;
  return is_on_surface(v.kind) ? scene.points().at(v.point).p : v.place;
}

InnerVertex inner_vertex(const scene::Scene& scene, const PathVertex& v, const FoundSurface* found) {
  InnerVertex inner;
  if (v.kind == Kind::surface) {
    inner.hit = found != nullptr ? found->hit : scene.points().hit(v.point);
    inner.delta = v.delta;
    return inner;
  }
  inner.kind = VertexKind::medium;
  inner.hit.p = Vec3(v.place);
  inner.medium = v.object;
  return inner;
}

// The light's end, and the edge that leaves it. next: x_1, or the lens.
bool set_light(const scene::Scene& scene, const PathVertex& v, Vec3d next, const scene::SurfaceHit& reference,
               Assembled& out) {
  FullPath& path = out.path;
  path.light.emitter = v.object;
  switch (v.kind) {
    case Kind::surface_light: {
      path.light = scene.points().hit(v.point);
      if (path.light.emitter == scene::kNone) return false;
      const Vec3d way = next - out.places.front();
      const double l = length(way);
      out.edges.front() = {way / l, l};
      return l > 0;
    }
    case Kind::distant_light:
      path.light_infinite = true;
      out.edges.front() = {-v.place, 0};
      return true;
    default:
      break;
  }
  // Such a light is the same however it is chosen.
  scene::DirectSample light;
  if (scene.lights().sample_emitter(v.object, reference, {}, light) != scene::DirectOutcome::sampled)
    return false;
  if (!light.delta || light.infinite != (v.kind == Kind::directed_light)) return false;
  path.light_infinite = path.light_delta_direction = light.infinite;
  path.light_delta_position = !light.infinite;
  path.light.p = light.p;
  const double distance = length(Vec3d(light.p) - next);
  const double squared = light.infinite ? 1 : distance * distance;
  path.light_delta_radiance = light.radiance * static_cast<float>(squared);
  out.edges.front() =
      light.infinite ? PathEdge{-Vec3d(light.wi), 0} : PathEdge{(next - Vec3d(light.p)) / distance, distance};
  return true;
}

}  // namespace

bool exists(const scene::Scene& scene, const Path& path) {
  const auto emitters = static_cast<std::uint32_t>(scene.lights().size());
  return std::all_of(path.vertices.begin(), path.vertices.end(), [&](const PathVertex& v) {
    if (is_on_surface(v.kind)) return scene.points().exists(v.point);
    if (v.kind == Kind::point_light || v.kind == Kind::directed_light) return v.object < emitters;
    if (v.kind == Kind::medium) return v.object < scene.features().media;
    return true;
  });
}

SharedVertices shared_vertices(const Assembled& of, const Path& from, const Path& to) {
  const PathRange changed = changed_range(from, to);
  return {&of, changed.begin, from.vertices.size() - changed.end};
}

bool assemble_into(Assembled& out, const scene::Scene& scene, const Path& path, float film_border,
                   const SharedVertices& shared, const FoundSurfaces* found) {
  const std::size_t k = path.edge_count();
  const std::size_t light = shared.light, sensor = shared.sensor;
  out.edges.resize(k);
  out.places.resize(k + 1);
  out.path.inner.reserve(k - 1);
  out.path.along.reserve(k);
  // True if two vertices that follow each other are shared.
  const auto shares = [&](std::size_t first) { return first + 1 < light || first + sensor > k; };
  if (light > 0) {
    const Assembled& other = *shared.of;
    std::copy_n(other.places.begin(), light, out.places.begin());
    const auto inner = static_cast<std::ptrdiff_t>(std::min(light, k)) - 1;
    out.path.inner.assign(other.path.inner.begin(), other.path.inner.begin() + inner);
  }
  for (std::size_t i = light; i + sensor <= k; ++i) {
    const PathVertex& v = path.vertices[i];
    const FoundSurface* met = nullptr;
    if (found != nullptr && is_on_surface(v.kind)) met = found->find(v.point);
    out.places[i] = place_of(scene, v, met);
    if (i > 0 && i < k) out.path.inner.push_back(inner_vertex(scene, v, met));
  }
  if (sensor > 0) {
    const Assembled& other = *shared.of;
    std::copy_n(other.places.end() - sensor, sensor, out.places.end() - sensor);
    const auto inner = static_cast<std::ptrdiff_t>(std::min(sensor, k)) - 1;
    out.path.inner.insert(out.path.inner.end(), other.path.inner.end() - inner, other.path.inner.end());
  }
  for (std::size_t i = 1; i + 1 < k; ++i) {
    if (shares(i)) {
      out.edges[i] = shared.of->edges[i + 1 < light ? i : i + shared.of->edges.size() - k];
      continue;
    }
    const Vec3d way = out.places[i + 1] - out.places[i];
    const double l = length(way);
    if (!(l > 0)) return false;
    out.edges[i] = {way / l, l};
  }
  // The lens, as the vertex before it sees it. Light from outside that the sensor looks at has no such place.
  if (k == 1 && path.vertices.front().kind != Kind::surface_light) return false;
  scene::SurfaceHit light_seen;
  if (k == 1) light_seen = scene.points().hit(path.vertices.front().point);
  const scene::SurfaceHit& seen = k == 1 ? light_seen : out.path.inner.back().hit;
  if (shares(k - 1)) {
    const Assembled& other = *shared.of;
    out.film = other.film;
    out.path.lens = other.path.lens;
    out.path.lens_infinite = other.path.lens_infinite;
    out.path.lens_near = other.path.lens_near;
    out.edges.back() = other.edges.back();
  } else {
    const Vec2 u_lens{static_cast<float>(path.vertices.back().place.x),
                      static_cast<float>(path.vertices.back().place.y)};
    scene::CameraSample camera;
    if (!scene.sample_camera(seen, u_lens, camera, film_border)) return false;
    out.film = {camera.film_x, camera.film_y};
    out.path.lens = camera.p;
    out.path.lens_infinite = camera.delta_direction;
    out.path.lens_near = camera.shadow_ray.origin + camera.shadow_ray.direction * camera.shadow_ray.t_max;
    const Vec3d way = Vec3d(camera.p) - out.places[k - 1];
    const double distance = length(way);
    if (!(distance > 0)) return false;
    out.edges.back() =
        camera.delta_direction ? PathEdge{Vec3d(camera.wi), 0} : PathEdge{way / distance, distance};
  }

  if (shares(0)) {
    const FullPath& other = shared.of->path;
    out.path.light = other.light;
    out.path.light_infinite = other.light_infinite;
    out.path.light_delta_position = other.light_delta_position;
    out.path.light_delta_direction = other.light_delta_direction;
    out.path.light_delta_radiance = other.light_delta_radiance;
    out.edges.front() = shared.of->edges.front();
  } else {
    const Vec3d next = k == 1 ? Vec3d(out.path.lens) : out.places[1];
    const PathEdge last = out.edges.back();
    if (!set_light(scene, path.vertices.front(), next, k == 1 ? seen : out.path.inner.front().hit, out))
      return false;
    if (k == 1) out.edges.back() = last;
  }
  for (const PathEdge& edge : out.edges) out.path.along.emplace_back(Vec3(edge.direction));
  return true;
}

std::optional<Assembled> assemble(const scene::Scene& scene, const Path& path, float film_border,
                                  const SharedVertices& shared, const FoundSurfaces* found) {
  std::optional<Assembled> out(std::in_place);
  if (!assemble_into(*out, scene, path, film_border, shared, found)) return std::nullopt;
  return out;
}

std::optional<Path> canonical(const scene::Scene& scene, const FullPath& path, Vec2 u_lens) {
  Path out;
  PathVertex light;
  if (path.light_delta_position || path.light_delta_direction) {
    light.kind = path.light_delta_position ? Kind::point_light : Kind::directed_light;
    light.object = path.light.emitter;
  } else if (path.light_infinite) {
    light.kind = Kind::distant_light;
    light.place = -normalize(Vec3d(path.along.front()));
  } else {
    light.kind = Kind::surface_light;
    const auto point = scene.points().of(path.light);
    if (!point) return std::nullopt;
    light.point = *point;
  }
  out.vertices.push_back(light);
  for (std::size_t i = 0; i < path.inner.size(); ++i) {
    const InnerVertex& inner = path.inner[i];
    PathVertex v;
    if (inner.kind == VertexKind::medium) {
      v.kind = Kind::medium;
      v.object = inner.medium;
      v.place = Vec3d(inner.hit.p);
    } else {
      const auto point = scene.points().of(inner.hit);
      if (!point) return std::nullopt;
      v.point = *point;
      v.delta = inner.delta;
      v.transmitted =
          inner.delta && dot(path.along[i], inner.hit.ng) * dot(path.along[i + 1], inner.hit.ng) > 0;
    }
    out.vertices.push_back(v);
  }
  PathVertex sensor;
  sensor.kind = Kind::sensor;
  sensor.place = {static_cast<double>(u_lens.x), static_cast<double>(u_lens.y), 0};
  out.vertices.push_back(sensor);
  return out;
}

}  // namespace candela::transport::path
