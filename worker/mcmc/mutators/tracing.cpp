#include "worker/mcmc/mutators/tracing.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "worker/core/math.h"
#include "worker/scene/bsdfs/delta_lobes.h"
#include "worker/scene/emitters/lights.h"
#include "worker/scene/points/surface_points.h"
#include "worker/transport/manifold/frame.h"

namespace candela::mcmc {

namespace path = transport::path;
using path::Kind;

namespace {

constexpr std::uint32_t kMaxPasses = 1000;

const scene::DeltaLobe* find_lobe(const std::vector<scene::DeltaLobe>& lobes, bool transmitted) {
  for (const scene::DeltaLobe& lobe : lobes)
    if (lobe.transmitted == transmitted && !lobe.passthrough && !lobe.value.is_black()) return &lobe;
  return nullptr;
}

// Reflected at n, or refracted into index `eta` times that of the side of wo. Nothing: total reflection.
std::optional<Vec3d> turned_at(Vec3d n, Vec3d wo, bool transmitted, double eta) {
  const double cosine = dot(wo, n);
  if (!transmitted) return normalize(n * (2 * cosine) - wo);
  const Vec3d across = (n * cosine - wo) / eta;
  const double rest = 1 - length_squared(across);
  if (!(rest > 0)) return std::nullopt;
  return normalize(across - n * std::copysign(std::sqrt(rest), cosine));
}

}  // namespace

bool differ_within(const path::Path& a, const path::Path& b, std::size_t begin, std::size_t end) {
  if (a.vertices.size() != b.vertices.size()) return false;
  for (std::size_t i = 0; i < a.vertices.size(); ++i) {
    const path::PathVertex &v = a.vertices[i], &w = b.vertices[i];
    if (v.kind != w.kind || v.delta != w.delta || v.transmitted != w.transmitted ||
        v.mollified != w.mollified)
      return false;
    if ((i < begin || i >= end) && !(v == w)) return false;
  }
  return true;
}

double LogStep::sample(rng::Stream& stream) const {
  return max * math::pow(min / max, stream.next_double());
}

std::optional<double> LogStep::log_pdf_plane(double distance) const {
  if (!(distance >= min && distance <= max)) return std::nullopt;
  return -math::log(2 * std::numbers::pi * distance * distance * math::log(max / min));
}

std::optional<double> LogStep::log_pdf_solid_angle(double angle) const {
  if (!(angle >= min && angle <= max)) return std::nullopt;
  double sine = 0, cosine = 0;
  math::sincos(angle, sine, cosine);
  return -math::log(2 * std::numbers::pi * angle * sine * math::log(max / min));
}

double angle_between(Vec3d a, Vec3d b) {
  return math::atan2(length(cross(a, b)), dot(a, b));
}

Vec3d turned(Vec3d direction, double angle, double azimuth) {
  const auto [s, t] =
      transport::manifold::has_pole_frame(direction)
          ? transport::manifold::pole_frame(direction)
          : transport::manifold::PoleFrame{transport::manifold::kPoleS, transport::manifold::kPoleT};
  double sine = 0, cosine = 0, across = 0, along = 0;
  math::sincos(angle, sine, cosine);
  math::sincos(azimuth, across, along);
  return normalize(direction * cosine + (s * along + t * across) * sine);
}

bool on_film(const MutatorContext& context, double x, double y) {
  const auto border = static_cast<double>(context.film_border);
  return x >= -border && y >= -border && x < context.film_width + border && y < context.film_height + border;
}

double film_distance(const PathState& a, const PathState& b) {
  const transport::FilmPosition p = a.assembled().film, q = b.assembled().film;
  const double x = static_cast<double>(p.x) - static_cast<double>(q.x),
               y = static_cast<double>(p.y) - static_cast<double>(q.y);
  return std::sqrt(x * x + y * y);
}

double far_on_film(const MutatorContext& context) {
  constexpr double kShare = 0.05;
  return std::sqrt(kShare * context.film_width * context.film_height / std::numbers::pi);
}

LogStep film_step(const MutatorContext& context, double size) {
  // [Veach 1997] has 0.1 pixels: half of the steps then stay within a pixel, which moves no light.
  constexpr double kMin = 1;
  return {kMin, std::max(4 * kMin, far_on_film(context) * size)};
}

double film_move(const MutatorContext& context, const PathState& from, const PathState& to) {
  const double distance = std::min(film_distance(from, to), far_on_film(context));
  return distance * distance;
}

double log_film_per_direction(const PathState& state, double film_area) {
  return math::log(state.evaluation().numbers().pdf_to_light.back() * film_area);
}

double pixel_width(const PathState& state, double film_area, double distance) {
  const double width = math::exp(-0.5 * log_film_per_direction(state, film_area));
  return state.assembled().path.lens_infinite ? width : width * distance;
}

double log_area_towards_light(const PathState& state, std::size_t begin, std::size_t end) {
  const path::PathNumbers& n = state.evaluation().numbers();
  double sum = 0;
  for (std::size_t i = begin; i < end; ++i) sum += math::log(n.factor_to_eye[i] / n.distance_squared[i]);
  return sum;
}

double log_area_towards_sensor(const PathState& state, std::size_t begin, std::size_t end) {
  const path::PathNumbers& n = state.evaluation().numbers();
  double sum = 0;
  for (std::size_t i = begin; i < end; ++i)
    sum += math::log(n.factor_to_light[i + 1] / n.distance_squared[i]);
  return sum;
}

double delta_index(const scene::Scene& scene, const PathState& state, std::size_t i) {
  if (!state.path.vertices[i].transmitted) return 1;
  const path::FullPath& full = state.assembled().path;
  const scene::SurfaceHit& hit = full.inner[i - 1].hit;
  const Vec3 wo = hit.shading.to_local(full.along[i]);
  scene::ClosureArena arena;
  const auto lobes = scene::delta_lobes(scene.closure(hit, wo, arena), wo, scene::TransportMode::radiance);
  const scene::DeltaLobe* lobe = find_lobe(lobes, true);
  return lobe == nullptr ? 1 : static_cast<double>(lobe->eta);
}

double log_turns_towards_sensor(const scene::Scene& scene, const PathState& state, std::size_t begin,
                                std::size_t end) {
  const path::FullPath& full = state.assembled().path;
  double sum = 0;
  for (std::size_t i = begin + 1; i < end; ++i) {
    if (!state.path.vertices[i].delta || !state.path.vertices[i].transmitted) continue;
    const Vec3d n(full.inner[i - 1].hit.shading.n);
    const double eta = delta_index(scene, state, i);
    sum += math::log(std::abs(dot(n, Vec3d(full.along[i])) / dot(n, Vec3d(full.along[i - 1]))) / (eta * eta));
  }
  return sum;
}

// A ray, and the line in double that it rounds.
struct Tracer::Beam {
  Ray ray;
  Vec3d origin, direction;
  bool in_space = false;  // it begins at a point light or in a medium: no surface there hides it
  scene::SurfaceHit hit;  // where it ends
};

std::uint32_t Tracer::bsdf_of(std::size_t i) const {
  const path::FullPath& full = from_.assembled().path;
  return i == 0 ? full.light.bsdf : full.inner[i - 1].hit.bsdf;
}

scene::SurfaceHit Tracer::hit_at(const scene::CanonicalPoint& point) const {
  if (context_.found == nullptr) return scene_.points().hit(point);
  const path::FoundSurface* found = context_.found->find(point);
  return found != nullptr ? found->hit : context_.found->add(scene_, point).hit;
}

Tracer::Beam Tracer::leave(const path::PathVertex& vertex, Vec3d direction) const {
  Beam beam;
  beam.direction = direction;
  if (path::is_on_surface(vertex.kind)) {
    const scene::SurfaceGeometry at = scene_.points().at(vertex.point);
    const auto error = static_cast<double>(hit_at(vertex.point).error);
    beam.origin = at.p;
    beam.ray = {Vec3(at.p + at.ng * (dot(direction, at.ng) < 0 ? -error : error)), Vec3(direction)};
    return beam;
  }
  beam.origin = vertex.kind == Kind::medium ? vertex.place : Vec3d(from_.assembled().path.light.p);
  beam.in_space = vertex.kind != Kind::medium;
  beam.ray = {Vec3(beam.origin), Vec3(direction)};
  return beam;
}

// The vertex gets where the beam ends: at the first surface that lets nothing pass straight, or has the bsdf
// of the path that is copied.
bool Tracer::meet(Beam& beam, std::size_t i, path::PathVertex& vertex) const {
  const bool leaves = vertex.kind == Kind::distant_light;
  const std::uint32_t bsdf = leaves ? scene::kNone : bsdf_of(i);
  const Vec3 start(beam.origin);
  for (std::uint32_t passes = 0; passes < kMaxPasses; ++passes) {
    const auto point = scene_.points().intersect(beam.ray, beam.origin, beam.direction);
    if (context_.rays != nullptr) ++*context_.rays;
    if (!point) {
      vertex.place = beam.direction;
      return leaves;
    }
    beam.hit = hit_at(*point);
    if (!(beam.in_space && goes_through(beam.hit, start))) {
      const bool copied = !leaves && beam.hit.bsdf == bsdf;
      if (copied || !scene_.features().any_passthrough ||
          scene_.passthrough(beam.hit, -beam.ray.direction).is_black()) {
        vertex.point = *point;
        return !leaves;
      }
    }
    beam.ray = spawn_ray(beam.hit, beam.ray.direction);
  }
  return false;
}

// From a specular vertex on.
bool Tracer::turn(Beam& beam, const path::PathVertex& vertex, bool towards_light) const {
  const scene::SurfaceGeometry at = scene_.points().at(vertex.point);
  const Vec3 wo = beam.hit.shading.to_local(Vec3(-beam.direction));
  scene::ClosureArena arena;
  const auto lobes =
      scene::delta_lobes(scene_.closure(beam.hit, wo, arena), wo,
                         towards_light ? scene::TransportMode::radiance : scene::TransportMode::importance);
  const scene::DeltaLobe* lobe = find_lobe(lobes, vertex.transmitted);
  if (lobe == nullptr) return false;
  const Vec3d normal = at.has_shading_derivatives ? at.n : Vec3d(beam.hit.shading.n);
  const auto exact = turned_at(normal, -beam.direction, vertex.transmitted, static_cast<double>(lobe->eta));
  const Vec3d rounded = normalize(Vec3d(beam.hit.shading.to_world(lobe->wi)));
  // A bsdf may turn its normal once more.
  const Vec3d direction = exact && dot(*exact, rounded) > 1 - 1e-5 ? *exact : rounded;
  const bool passes = dot(direction, at.ng) * dot(beam.direction, at.ng) > 0;
  if (passes != vertex.transmitted) return false;
  beam = leave(vertex, direction);
  return true;
}

bool Tracer::follow(Beam beam, path::Path& path, std::size_t first, std::size_t last) const {
  const bool towards_light = last < first;
  for (std::size_t i = first;; towards_light ? --i : ++i) {
    path::PathVertex& vertex = path.vertices[i];
    if (!meet(beam, i, vertex)) return false;
    if (vertex.kind == Kind::surface_light && beam.hit.emitter == scene::kNone) return false;
    if (i == last) return true;
    if (!turn(beam, vertex, towards_light)) return false;
  }
}

bool Tracer::trace_film(double film_x, double film_y, path::Path& path, std::size_t last) const {
  const Vec3d numbers = path.vertices.back().place;
  float weight = 1;
  Beam beam;
  beam.ray = scene_.camera_ray(static_cast<float>(film_x), static_cast<float>(film_y),
                               {static_cast<float>(numbers.x), static_cast<float>(numbers.y)}, weight);
  beam.origin = Vec3d(beam.ray.origin);
  beam.direction = normalize(Vec3d(beam.ray.direction));
  return follow(beam, path, path.edge_count() - 1, last);
}

bool Tracer::trace(std::size_t start, Vec3d direction, path::Path& path, std::size_t first,
                   std::size_t last) const {
  return follow(leave(path.vertices[start], direction), path, first, last);
}

bool Tracer::stops_at(const PathState& to, std::size_t start, std::size_t first, std::size_t last) const {
  if (!scene_.features().any_passthrough) return true;
  const path::FullPath& full = to.assembled().path;
  const bool towards_light = first < start;
  for (std::size_t i = first, before = start;; before = i, towards_light ? --i : ++i) {
    const std::size_t edge = towards_light ? i : before;
    const Vec3d along = to.assembled().edges[edge].direction, d = towards_light ? -along : along;
    Beam beam;
    if (to.path.vertices[before].kind == Kind::sensor) {
      beam.origin = Vec3d(full.lens_near);
      beam.direction = d;
      beam.ray = {full.lens_near, Vec3(d)};
    } else {
      beam = leave(to.path.vertices[before], d);
    }
    path::PathVertex met = to.path.vertices[i];
    if (!meet(beam, i, met)) return false;
    if (met.kind != Kind::distant_light) {
      const Vec3d place = scene_.points().at(to.path.vertices[i].point).p;
      const double miss = length(scene_.points().at(met.point).p - place);
      if (!(miss <= 1e-4 * length(place - beam.origin))) return false;
    }
    if (i == last) return true;
  }
}

}  // namespace candela::mcmc
