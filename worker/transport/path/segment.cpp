#include "worker/transport/path/segment.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "worker/scene/bsdfs/lobe_shapes.h"
#include "worker/scene/points/surface_points.h"
#include "worker/transport/manifold/frame.h"

namespace candela::transport::path {
namespace {

using manifold::ChainVertex;

constexpr double kIndexMatched = 1e-3;  // of |eta - 1| [half-vector note, section 2]

// All of the vertex that follows from its surface. error: of the point's hit. False: a map turns the normal,
// or there are no tangents.
bool set_surface(const scene::Scene& scene, const scene::CanonicalPoint& point, float error, ChainVertex& v) {
  const scene::SurfaceGeometry at = scene.points().at(point);
  v.x = at.p;
  v.ng = at.ng;
  v.n = at.n;
  v.p_u = at.dp_du;
  v.p_v = at.dp_dv;
  v.n_u = at.dn_du;
  v.n_v = at.dn_dv;
  v.point = point;
  v.error = static_cast<double>(error);
  return at.has_shading_derivatives && orthonormalize(v);
}

bool set_end(const scene::Scene& scene, const scene::CanonicalPoint& point, float error, ChainVertex& v) {
  // Derivatives of an end's normal are in no formula.
  return set_surface(scene, point, error, v) || length(v.p_u) > 0;
}

void set_tangents(ChainVertex& v) {
  const auto [s, t] = manifold::has_pole_frame(v.ng)
                          ? manifold::pole_frame(v.ng)
                          : manifold::PoleFrame{manifold::kPoleS, manifold::kPoleT};
  v.p_u = s;
  v.p_v = t;
}

// An end that is no surface; its cosine does not count, or is that of a lens facing its neighbor.
ChainVertex free_end(Vec3d x, Vec3d towards) {
  ChainVertex v;
  v.x = x;
  v.n = v.ng = towards;
  set_tangents(v);
  return v;
}

NoSegment set_end(const scene::Scene& scene, const Path& path, const Assembled& assembled, std::size_t i,
                  Segment& out) {
  const PathVertex& named = path.vertices[i];
  if (named.kind == Kind::medium) return NoSegment::medium;
  ChainVertex v;
  if (is_on_surface(named.kind)) {
    const scene::SurfaceHit& hit = i == 0 ? assembled.path.light : assembled.path.inner[i - 1].hit;
    if (!set_end(scene, named.point, hit.error, v)) return NoSegment::map;
  } else if (named.kind == Kind::sensor) {
    if (assembled.path.lens_infinite) return NoSegment::far_sensor;
    v = free_end(Vec3d(assembled.path.lens), -assembled.edges.back().direction);
  } else if (named.kind == Kind::point_light) {
    v = free_end(Vec3d(assembled.path.light.p), assembled.edges.front().direction);
  } else {
    v = free_end(-assembled.edges.front().direction, -assembled.edges.front().direction);
  }
  if (i == out.begin) {
    out.chain.first = is_on_surface(named.kind)         ? manifold::FirstEnd::surface
                      : named.kind == Kind::point_light ? manifold::FirstEnd::point
                                                        : manifold::FirstEnd::direction;
  }
  out.chain.vertices.push_back(v);
  return NoSegment::none;
}

NoSegment set_inner(const scene::Scene& scene, const Path& path, const Assembled& assembled, std::size_t i,
                    Segment& out) {
  const PathVertex& named = path.vertices[i];
  if (named.kind != Kind::surface) return NoSegment::medium;
  ChainVertex v;
  const scene::SurfaceHit& hit = assembled.path.inner[i - 1].hit;
  if (!set_surface(scene, named.point, hit.error, v)) return NoSegment::map;
  const Vec3d to_light = -assembled.edges[i - 1].direction, to_eye = assembled.edges[i].direction;
  const bool transmitted = dot(to_light, v.n) * dot(to_eye, v.n) < 0;
  const Vec3 wo = hit.shading.to_local(Vec3(to_eye));
  scene::ClosureArena arena;
  const scene::Closure closure = scene.closure(hit, wo, arena);
  double alpha = 2;
  for (const scene::LobeShape& lobe : scene::lobe_shapes(closure, wo)) {
    if (lobe.transmitted != transmitted || (lobe.alpha == 0) != named.delta || lobe.alpha >= alpha) continue;
    alpha = lobe.alpha;
    v.eta = 1 / lobe.eta;  // the lobe's is that of the light's side over the eye's
  }
  if (alpha > 1) return NoSegment::no_lobe;
  if (transmitted && std::abs(v.eta - 1) < kIndexMatched) return NoSegment::index_matched;
  v.scatter = transmitted ? manifold::Scatter::refract : manifold::Scatter::reflect;
  out.chain.vertices.push_back(v);
  out.alphas.push_back(alpha);
  out.bsdfs.push_back(hit.bsdf);
  return NoSegment::none;
}

}  // namespace

bool set_end_surface(const scene::Scene& scene, const scene::CanonicalPoint& point, ChainVertex& v) {
  return set_end(scene, point, scene.points().hit(point).error, v);
}

NoSegment make_segment(const scene::Scene& scene, const Path& path, const Assembled& assembled,
                       std::size_t begin, std::size_t end, Segment& out) {
  out = {};
  out.begin = begin;
  out.end = end;
  out.chain.vertices.reserve(end - begin + 1);
  out.alphas.reserve(end - begin - 1);
  out.bsdfs.reserve(end - begin - 1);
  NoSegment reason = set_end(scene, path, assembled, begin, out);
  for (std::size_t i = begin + 1; i < end && reason == NoSegment::none; ++i)
    reason = set_inner(scene, path, assembled, i, out);
  if (reason == NoSegment::none) reason = set_end(scene, path, assembled, end, out);
  return reason;
}

double least_alpha(const scene::Scene& scene, const Path& path, const Assembled& assembled, std::size_t i) {
  const scene::SurfaceHit& hit = assembled.path.inner[i - 1].hit;
  const Vec3 wo = hit.shading.to_local(Vec3(assembled.edges[i].direction));
  scene::ClosureArena arena;
  double least = std::numeric_limits<double>::infinity();
  for (const scene::LobeShape& lobe : scene::lobe_shapes(scene.closure(hit, wo, arena), wo))
    if ((lobe.alpha == 0) == path.vertices[i].delta) least = std::min(least, lobe.alpha);
  return least;
}

Path with_segment(const Path& path, const Segment& segment, const manifold::Chain& chain) {
  Path out = path;
  for (std::size_t i = segment.begin + 1; i < segment.end; ++i)
    out.vertices[i].point = chain.vertices[i - segment.begin].point;
  return out;
}

bool SceneSurfaces::meet(std::size_t i, const ChainVertex& from, Vec3d towards, ChainVertex& out) const {
  constexpr std::uint32_t kMaxPasses = 1000;
  const Vec3d d = normalize(towards - from.x);
  const double side = dot(d, from.ng) < 0 ? -from.error : from.error;
  Ray ray{Vec3(from.x + from.ng * side), Vec3(d)};
  for (std::uint32_t passes = 0; passes < kMaxPasses; ++passes) {
    const auto point = scene_.points().intersect(ray, from.x, d);
    if (rays_ != nullptr) ++*rays_;
    if (!point) return false;
    const scene::SurfaceHit hit = scene_.points().hit(*point);
    if (hit.bsdf == segment_.bsdfs[i - 1]) return set_surface(scene_, *point, hit.error, out);
    if (scene_.passthrough(hit, Vec3(-d)).is_black()) return false;
    ray = spawn_ray(hit, Vec3(d));
  }
  return false;
}

std::optional<manifold::Mat2> to_film(const scene::Scene& scene, const ChainVertex& v, double length,
                                      Vec2 u_lens) {
  const double h = length * 0x1p-10;
  const auto film = [&](Vec3d p, manifold::Pair& out) {
    scene::SurfaceHit hit;
    hit.p = Vec3(p);
    hit.ng = Vec3(v.ng);
    scene::CameraSample camera;
    if (!scene.sample_camera(hit, u_lens, camera, 1e9f)) return false;
    out = {static_cast<double>(camera.film_x), static_cast<double>(camera.film_y)};
    return true;
  };
  manifold::Pair low_u, high_u, low_v, high_v;
  if (!film(v.x - v.p_u * h, low_u) || !film(v.x + v.p_u * h, high_u) || !film(v.x - v.p_v * h, low_v) ||
      !film(v.x + v.p_v * h, high_v))
    return std::nullopt;
  const manifold::Pair u = (high_u - low_u) * (1 / (2 * h)), w = (high_v - low_v) * (1 / (2 * h));
  return manifold::Mat2{u.x, w.x, u.y, w.y};
}

}  // namespace candela::transport::path
