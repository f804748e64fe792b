#include "worker/mcmc/mutators/subpath_walk.h"

#include <algorithm>
#include <cmath>

#include "worker/core/math.h"
#include "worker/scene/points/surface_points.h"
#include "worker/transport/between.h"
#include "worker/transport/scattering.h"

namespace candela::mcmc {

using transport::path::Kind;
using transport::path::PathVertex;

namespace {

// The inverse of warp::concentric_disk.
Vec2 square_of_disk(double x, double y) {
  constexpr double kFourOverPi = 1.2732395447351628;
  const double r = std::min(std::sqrt(x * x + y * y), 1.0);
  double a = 0, b = 0;
  if (std::abs(x) > std::abs(y)) {
    a = x < 0 ? -r : r;
    b = a * kFourOverPi * math::atan2(y / x, 1);
  } else if (y != 0) {
    b = y < 0 ? -r : r;
    a = b * kFourOverPi * math::atan2(x / y, 1);
  }
  const auto unit = [](double v) { return static_cast<float>(std::clamp((v + 1) / 2, 0.0, 1.0)); };
  return {unit(a), unit(b)};
}

// The numbers of a point of the lens, as `seen` sees it. False: it does not see the lens.
bool numbers_of_lens_point(const scene::Scene& scene, const scene::SurfaceHit& seen, Vec3 p, Vec2& u_lens) {
  constexpr float kAnywhere = 1e9f;  // of the film
  scene::CameraSample center, right, top;
  if (!scene.sample_camera(seen, {0.5f, 0.5f}, center, kAnywhere) ||
      !scene.sample_camera(seen, {1, 0.5f}, right, kAnywhere) ||
      !scene.sample_camera(seen, {0.5f, 1}, top, kAnywhere))
    return false;
  const Vec3d c(center.p), x = Vec3d(right.p) - c, y = Vec3d(top.p) - c, at = Vec3d(p) - c;
  if (!(length_squared(x) > 0) || !(length_squared(y) > 0)) return false;
  u_lens = square_of_disk(dot(at, x) / length_squared(x), dot(at, y) / length_squared(y));
  return true;
}

}  // namespace

std::optional<scene::CanonicalPoint> point_of_emitter(const scene::Scene& scene, std::uint32_t emitter,
                                                      Vec3 p, Vec3 d, double near) {
  constexpr int kMaxInFront = 64;
  const Vec3d line = normalize(Vec3d(d));
  Ray ray{p - d * static_cast<float>(near), d};
  for (int i = 0; i < kMaxInFront; ++i) {
    const auto point = scene.points().intersect(ray, Vec3d(p), line);
    if (!point) return std::nullopt;
    const scene::SurfaceHit found = scene.points().hit(*point);
    const double off = length(Vec3d(found.p) - Vec3d(p));
    if (found.emitter == emitter && off <= 1e-3 * near + 16 * static_cast<double>(found.error)) return point;
    if (off > 2 * near) return std::nullopt;
    ray = spawn_ray(found, d);
  }
  return std::nullopt;
}

Vec2 draw_lens(const scene::Scene& scene, rng::Stream& stream) {
  const float x = stream.next_float(), y = stream.next_float();
  return scene.reads_lens() ? Vec2{x, y} : Vec2{0.5f, 0.5f};
}

PathVertex sensor_vertex(Vec2 u_lens) {
  PathVertex sensor;
  sensor.kind = Kind::sensor;
  sensor.place = {static_cast<double>(u_lens.x), static_cast<double>(u_lens.y), 0};
  return sensor;
}

void SubpathWalk::start_at(const PathVertex& vertex, const scene::SurfaceHit& hit, Vec3d place, Vec3 wo,
                           std::uint32_t medium) {
  vertex_ = vertex;
  hit_ = hit;
  wo_ = wo;
  place_ = place;
  medium_ = medium;
  kept_ = true;
  sampled_ = false;
}

void SubpathWalk::start_at_sensor(PathVertex& vertex) {
  const Vec2 u_lens = draw_lens(scene_, stream_);
  const auto border = static_cast<double>(context_.film_border);
  const double x = stream_.next_double() * (context_.film_width + 2 * border) - border;
  const double y = stream_.next_double() * (context_.film_height + 2 * border) - border;
  float weight = 1;
  ray_ = scene_.camera_ray(static_cast<float>(x), static_cast<float>(y), u_lens, weight);
  direction_ = ray_.direction;
  origin_ = Vec3d(ray_.origin);
  if (has_media()) medium_ = scene_.camera_medium(ray_);
  vertex = sensor_vertex(u_lens);
}

bool SubpathWalk::start_at_light(PathVertex& vertex) {
  const float u_select = stream_.next_float();
  const float px = stream_.next_float(), py = stream_.next_float();
  const float dx = stream_.next_float(), dy = stream_.next_float();
  scene::EmissionSample light;
  if (!scene_.sample_emission(u_select, {px, py}, {dx, dy}, light)) return false;
  ray_ = light.ray;
  direction_ = ray_.direction;
  origin_ = Vec3d(ray_.origin);
  vertex = {};
  if (light.delta_position || light.delta_direction) {
    vertex.kind = light.delta_position ? Kind::point_light : Kind::directed_light;
    vertex.object = light.vertex.emitter;
    from_point_ = light.delta_position;
    if (from_point_) origin_ = Vec3d(light.vertex.p);
  } else if (light.infinite) {
    vertex.kind = Kind::distant_light;
    vertex.place = -normalize(Vec3d(direction_));
  } else {
    // The sample names the triangle only if the lamp is a mesh.
    auto point = scene_.points().of(light.vertex);
    if (!point)
      point = point_of_emitter(scene_, light.vertex.emitter, light.vertex.p, -light.vertex.ng,
                               1e-4 * static_cast<double>(scene_.features().radius));
    if (!point) return false;
    vertex.kind = Kind::surface_light;
    vertex.point = *point;
    origin_ = scene_.points().at(*point).p;
  }
  hit_ = light.vertex;
  if (!has_media()) return true;
  medium_ = scene_.emitter_medium(light);
  from_outside_ = light.infinite && medium_ != scene::kNone;
  // All of the medium outside, which has no end.
  return !from_outside_ || stream_.next_double() < static_cast<double>(scene_.medium(medium_).prob_pass(
                                                       Ray().t_max, Spectrum(1.0f)));
}

void SubpathWalk::enter_medium_beyond() {
  if (has_media()) medium_ = scene_.medium_beyond(hit_, direction_, medium_);
}

void SubpathWalk::sample() {
  const float u_lobe = stream_.next_float(), ux = stream_.next_float(), uy = stream_.next_float();
  const Vec3 wo = hit_.shading.to_local(wo_);
  scene::ClosureArena arena;
  const scene::Closure closure = scene_.closure(hit_, wo, arena);
  scatters_ = !closure.black &&
              transport::SurfaceScattering(hit_, closure, wo_, wo).sample(u_lobe, {ux, uy}, mode_, next_);
  sampled_ = true;
}

bool SubpathWalk::leave_medium() {
  kept_ = false;
  const scene::Medium& medium = scene_.medium(vertex_.object);
  if (medium.albedo(hit_.p).is_black()) return false;
  const float ux = stream_.next_float(), uy = stream_.next_float();
  medium.phase().sample(wo_, {ux, uy}, direction_);
  origin_ = Vec3d(hit_.p);
  ray_ = {hit_.p, direction_};
  return true;
}

bool SubpathWalk::leave(PathVertex& vertex) {
  if (vertex.kind == Kind::medium) return leave_medium();
  if (!sampled_) sample();
  sampled_ = false;
  // A kept vertex stays as it is, and stays a vertex.
  if (!scatters_ || next_.passthrough || (kept_ && next_.delta)) return false;
  kept_ = false;
  direction_ = hit_.shading.to_world(next_.wi);
  vertex.delta = next_.delta;
  vertex.transmitted = next_.delta && dot(direction_, hit_.ng) * dot(wo_, hit_.ng) < 0;
  origin_ = place_ ? *place_ : scene_.points().at(vertex_.point).p;
  ray_ = spawn_ray(hit_, direction_);
  enter_medium_beyond();
  return true;
}

// A flight through the medium up to hit_, if there is one; it does not know the walk's colors, so that its
// density is one of the path. True: it ends at a new vertex.
bool SubpathWalk::scatters_before(bool found) {
  if (medium_ == scene::kNone || from_outside_) return false;
  scene::SurfaceHit end = hit_;
  end.distance = static_cast<float>(length(Vec3d(hit_.p) - Vec3d(ray_.origin)));
  const float ux = stream_.next_float(), uy = stream_.next_float();
  const scene::DistanceSample flight = scene_.medium(medium_).sample_distance(
      transport::inside_medium(ray_, found ? &end : nullptr), Spectrum(1.0f), {ux, uy});
  if (!flight.scattered) return false;
  vertex_ = {};
  vertex_.kind = Kind::medium;
  vertex_.object = medium_;
  transport::medium_vertex(ray_, flight.distance, hit_);
  vertex_.place = Vec3d(hit_.p);
  place_ = vertex_.place;
  wo_ = -direction_;
  return true;
}

// The sensor between here and hit_.
bool SubpathWalk::meets_lens(bool found) {
  float distance = 0;
  scene::CameraDensity camera;
  scene::SurfaceHit next = hit_;
  next.distance = static_cast<float>(length(Vec3d(hit_.p) - Vec3d(ray_.origin)));
  return scene_.meets_camera(ray_, found ? &next : nullptr, distance, camera, context_.film_border) && [&] {
    Vec2 u_lens;
    scene::SurfaceHit from;
    from.p = Vec3(origin_);
    from.ng = direction_;
    if (!numbers_of_lens_point(scene_, from, camera.p, u_lens)) return false;
    vertex_ = sensor_vertex(u_lens);
    return true;
  }();
}

void SubpathWalk::set_met(const scene::CanonicalPoint& point) {
  if (context_.found == nullptr) {
    hit_ = scene_.points().hit(point);
    place_.reset();
    return;
  }
  const transport::path::FoundSurface& found = context_.found->add(scene_, point);
  hit_ = found.hit;
  place_ = found.place;
}

SubpathWalk::Arrival SubpathWalk::arrive(bool lens) {
  const bool passthrough = scene_.features().any_passthrough;
  const Vec3d line = normalize(Vec3d(direction_));
  for (std::uint32_t passes = 0; passes < transport::kMaxPasses; ++passes) {
    const auto point = scene_.points().intersect(ray_, origin_, line);
    if (context_.rays != nullptr) ++*context_.rays;
    if (point) set_met(*point);
    if (point && from_point_ && scene::goes_through(hit_, Vec3(origin_))) {
      enter_medium_beyond();
      ray_ = spawn_ray(hit_, direction_);
      continue;
    }
    if (lens && meets_lens(point.has_value())) return Arrival::lens;
    if (scatters_before(point.has_value())) {
      from_point_ = false;
      return lens ? Arrival::failed : Arrival::medium;
    }
    from_outside_ = false;
    if (!point) return Arrival::left;
    vertex_ = {};
    vertex_.point = *point;
    wo_ = -direction_;
    if (passthrough) sample();
    if (!passthrough || !scatters_ || !next_.passthrough) {
      from_point_ = false;
      return lens ? Arrival::failed : Arrival::surface;
    }
    sampled_ = false;
    enter_medium_beyond();
    ray_ = spawn_ray(hit_, direction_);
  }
  return Arrival::failed;
}

}  // namespace candela::mcmc
