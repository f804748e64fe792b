#include "worker/transport/path/evaluation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "worker/core/math.h"
#include "worker/scene/bsdfs/delta_lobes.h"
#include "worker/scene/bsdfs/edited.h"
#include "worker/scene/bsdfs/path_edited.h"
#include "worker/scene/objects.h"
#include "worker/transport/between.h"
#include "worker/transport/scattering.h"
#include "worker/transport/technique/mollify.h"

namespace candela::transport::path {
namespace {

using Channels = std::array<double, 3>;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

Channels channels(Spectrum s) {
  return {static_cast<double>(s.r), static_cast<double>(s.g), static_cast<double>(s.b)};
}
double mean(const Channels& c) {
  return (c[0] + c[1] + c[2]) / 3;
}
void multiply(Channels& a, const Channels& b, double scale = 1) {
  for (std::size_t i = 0; i < 3; ++i) a[i] *= b[i] * scale;
}
double cosine(Vec3 a, Vec3 b) {
  return std::max(std::abs(dot(Vec3d(a), Vec3d(b))), static_cast<double>(kMinCosine));
}

// exp(-sigma_t length).
Channels closed_transmittance(const scene::Medium& medium, double length) {
  const Channels sigma = channels(medium.sigma_t({}));
  Channels t{};
  for (std::size_t i = 0; i < 3; ++i) t[i] = sigma[i] > 0 ? math::exp(-sigma[i] * length) : 1;
  return t;
}

struct DeltaLobe {
  double prob = 0, eta = 1;
  Channels value{};  // weight * prob
};

// The delta lobe that a walk takes which comes from wo and leaves along wi (local); of several the one of
// probability nearest to `prob`, if that is given.
DeltaLobe find_delta(const scene::Closure& closure, Vec3 wo, Vec3 wi, TransportMode mode, bool passthrough,
                     double prob) {
  DeltaLobe best;
  double nearest = kInfinity;
  for (const scene::DeltaLobe& lobe : scene::delta_lobes(closure, wo, mode)) {
    if (lobe.passthrough != passthrough || dot(lobe.wi, wi) < 1 - 1e-5f) continue;
    const auto found = static_cast<double>(lobe.prob);
    const double distance = prob > 0 ? std::abs(found - prob) : 0;
    if (distance >= nearest) continue;
    nearest = distance;
    best.prob = found;
    best.eta = static_cast<double>(lobe.eta);
    best.value = channels(lobe.value);
  }
  return best;
}

}  // namespace

Evaluation::Evaluation(const scene::Scene& scene, const FullPath& path, const Rules& rules,
                       const SharedEnds& shared, Wanted wanted)
    : scene_(scene), path_(path), rules_(rules) {
  const std::size_t k = path.edge_count();
  PathNumbers& n = numbers_;
  n.edges = k;
  n.pdf_to_eye.assign(k + 1, 0);
  n.pdf_to_light.assign(k + 1, 0);
  n.factor_to_eye.assign(k + 1, 1);
  n.factor_to_light.assign(k + 1, 1);
  n.survival.assign(k, 1);
  n.distance_squared.assign(k, 1);
  n.delta.assign(k + 1, false);
  n.in_medium.assign(k + 1, false);
  n.medium.assign(k + 1, scene::kNone);
  n.beam_sine.assign(k + 1, 0);
  edges_.resize(k);
  for (std::size_t i = 0; i < k; ++i) {
    if (copy_edge(shared, i)) continue;
    if (!(i == 0 && path.light_infinite) && !(i + 1 == k && path.lens_infinite))
      n.distance_squared[i] = length_squared(place(i + 1) - place(i));
  }
  inner_.resize(k - 1);
  for (std::size_t i = 1; i < k; ++i)
    if (!copy_inner(shared, i)) evaluate_inner(i);
  if (shared.light >= 2) {
    const Evaluation& other = *shared.of;
    n.light_can_be_hit = other.numbers_.light_can_be_hit;
    n.light_prob = other.numbers_.light_prob;
    n.pdf_to_eye[0] = other.numbers_.pdf_to_eye[0];
    n.factor_to_eye[0] = other.numbers_.factor_to_eye[0];
    emitted_ = other.emitted_;
  } else {
    evaluate_light();
  }
  if (shared.light >= 3)
    n.light_direct = shared.of->numbers_.light_direct;
  else if (k > 1)
    evaluate_light_direct();
  if (shared.sensor >= 2) {
    const PathNumbers& other = shared.of->numbers_;
    n.lens_can_be_hit = other.lens_can_be_hit;
    n.lens_prob = other.lens_prob;
    n.lens_connect = other.lens_connect;
    n.factor_to_light[k] = other.factor_to_light.back();
    n.pdf_to_light[k] = other.pdf_to_light.back();
    importance_ = shared.of->importance_;
  } else {
    valid_ = evaluate_sensor();
  }
  if (wanted == Wanted::if_lit && !may_be_lit()) valid_ = false;
  for (std::size_t i = 0; i < k && valid_; ++i)
    if (edges_[i].stretches.size() == 0) valid_ = follow_edge(i);
  rules_.rays = nullptr;
  if (valid_ && scene.features().media > 0) assign_media();
}

bool Evaluation::may_be_lit() const {
  const auto lit = [](const Channels& c) { return c[0] > 0 || c[1] > 0 || c[2] > 0; };
  return importance_ > 0 && lit(emitted_) &&
         std::all_of(inner_.begin(), inner_.end(), [&](const Inner& x) { return lit(x.value); });
}

bool Evaluation::copy_edge(const SharedEnds& shared, std::size_t i) {
  const std::size_t k = numbers_.edges;
  std::size_t from = i;
  if (i + 2 > shared.light) {
    if (i + shared.sensor < k + 1) return false;
    from = i + shared.of->numbers_.edges - k;
  }
  if (const Edge& other = shared.of->edges_[from]; other.stretches.size() == 1)
    edges_[i].stretches.push_back(other.stretches[0]);
  else
    edges_[i] = other;
  numbers_.distance_squared[i] = shared.of->numbers_.distance_squared[from];
  return true;
}

bool Evaluation::copy_inner(const SharedEnds& shared, std::size_t i) {
  const std::size_t k = numbers_.edges;
  std::size_t from = i;
  if (i + 2 > shared.light) {
    if (i + shared.sensor < k + 2) return false;
    from = i + shared.of->numbers_.edges - k;
  }
  if (path_.inner[i - 1].cone != shared.of->path_.inner[from - 1].cone) return false;
  const PathNumbers& other = shared.of->numbers_;
  numbers_.pdf_to_eye[i] = other.pdf_to_eye[from];
  numbers_.pdf_to_light[i] = other.pdf_to_light[from];
  numbers_.factor_to_eye[i] = other.factor_to_eye[from];
  numbers_.factor_to_light[i] = other.factor_to_light[from];
  numbers_.delta[i] = other.delta[from];
  numbers_.in_medium[i] = other.in_medium[from];
  numbers_.medium[i] = other.medium[from];
  numbers_.beam_sine[i] = other.beam_sine[from];
  inner_[i - 1] = shared.of->inner_[from - 1];
  return true;
}

double Evaluation::rounding() const {
  constexpr double kOfCosine = 0x1p-22;
  const std::size_t k = path_.edge_count();
  double rounding = 0;
  for (std::size_t i = 0; i < edges_.size(); ++i) {
    double ends = 0;  // of the edge's stretches, along it
    const auto surface = [&](const scene::SurfaceHit& hit, Vec3 d) {
      const double c = cosine(d, hit.ng);
      rounding += kOfCosine / c;
      ends += static_cast<double>(hit.error) / c;
    };
    const Vec3 d = path_.along[i];
    if (i > 0 && path_.inner[i - 1].kind == VertexKind::surface) surface(path_.inner[i - 1].hit, d);
    if (i + 1 < k && path_.inner[i].kind == VertexKind::surface) surface(path_.inner[i].hit, d);
    if (i == 0 && path_.light.emitter != scene::kNone && length_squared(path_.light.ng) > 0)
      surface(path_.light, d);
    for (const Pass& pass : edges_[i].passes) surface(pass.hit, d);
    double thickest = 0;
    for (std::size_t j = 0; j < edges_[i].stretches.size(); ++j) {
      const std::uint32_t medium = edges_[i].stretches[j].medium;
      if (medium == scene::kNone) continue;
      thickest = std::max(thickest, static_cast<double>(scene_.medium(medium).max_sigma_t().max_component()));
    }
    rounding += 2 * thickest * ends;
  }
  return rounding;
}

Vec3d Evaluation::place(std::size_t i) const {
  if (i == 0) return Vec3d(path_.light.p);
  return Vec3d(i == path_.edge_count() ? path_.lens : path_.inner[i - 1].hit.p);
}

// Surfaces on the way from x_i to x_{i+1}; all of them have to let light pass straight. The first edge of
// light from outside is followed from its other end.
bool Evaluation::follow_edge(std::size_t i) {
  const std::size_t k = path_.edge_count();
  const bool from_outside = i == 0 && path_.light_infinite;
  const Vec3 d = from_outside ? -path_.along[0] : path_.along[i];
  const std::size_t start = from_outside ? 1 : i;
  const bool at_lens = start == k;
  const bool start_in_space = at_lens || (start == 0 ? path_.light_delta_position
                                                     : path_.inner[start - 1].kind == VertexKind::medium);
  const Vec3 p = at_lens ? path_.lens_near : Vec3(place(start));
  const scene::SurfaceHit* surface = start_in_space ? nullptr
                                     : start == 0   ? &path_.light
                                                    : &path_.inner[start - 1].hit;
  Ray ray = surface == nullptr ? Ray{p, d} : spawn_ray(*surface, d);

  const scene::SurfaceHit* target = nullptr;  // a surface that ends the edge
  if (!from_outside && i + 1 < k && path_.inner[i].kind == VertexKind::surface) target = &path_.inner[i].hit;
  const Vec3d end = from_outside ? Vec3d{} : i + 1 == k ? Vec3d(path_.lens_near) : place(i + 1);
  Vec3d last(p);
  Edge& edge = edges_[i];
  for (std::uint32_t passes = 0; passes < 1000; ++passes) {
    scene::SurfaceHit hit;
    bool found = scene_.intersect(ray, hit);
    if (rules_.rays != nullptr) ++*rules_.rays;
    while (found && start == 0 && start_in_space && goes_through(hit, p)) {  // nor do they hide it
      ray = spawn_ray(hit, d);
      found = scene_.intersect(ray, hit);
    }
    const double rest = from_outside ? kInfinity : length(end - last);
    const double reached = found ? length(Vec3d(hit.p) - last) : kInfinity;
    // Within what rounding may move the surface along the ray.
    const double slack = 1e-5 * rest + 4 * static_cast<double>(hit.error) / cosine(d, hit.ng);
    const bool arrived = !found || reached >= rest - slack ||
                         (target != nullptr && hit.shape == target->shape &&
                          hit.primitive == target->primitive && reached >= 0.99 * rest);
    if (arrived) {
      if (from_outside && found) return false;
      edge.stretches.push_back({scene::kNone, rest});
      break;
    }
    Pass pass;
    pass.hit = hit;
    // Viewed from the eye, that is from where the light goes to.
    pass.fraction = channels(scene_.passthrough(hit, path_.along[i]));
    if (!(pass.fraction[0] + pass.fraction[1] + pass.fraction[2] > 0)) return false;
    edge.stretches.push_back({scene::kNone, reached});
    edge.passes.push_back(pass);
    last = Vec3d(hit.p);
    ray = spawn_ray(hit, d);
  }
  if (from_outside) {
    const std::size_t count = edge.stretches.size();
    for (std::size_t j = 0; j < count / 2; ++j) std::swap(edge.stretches[j], edge.stretches[count - 1 - j]);
    std::reverse(edge.passes.begin(), edge.passes.end());
  }
  for (Pass& pass : edge.passes) {
    const Vec3 to_eye = pass.hit.shading.to_local(path_.along[i]);
    scene::ClosureArena arena;
    const scene::Closure from_eye = scene_.closure(pass.hit, to_eye, arena);
    pass.prob_from_eye = find_delta(from_eye, to_eye, -to_eye, TransportMode::radiance, true, 0).prob;
    arena.clear();
    const scene::Closure from_light = scene_.closure(pass.hit, -to_eye, arena);
    pass.prob_from_light = find_delta(from_light, -to_eye, to_eye, TransportMode::importance, true, 0).prob;
  }
  return edge.stretches.size() == edge.passes.size() + 1;
}

// From the light on, and in comparison from the eye on. Survival and transmittance follow.
void Evaluation::assign_media() {
  const std::size_t k = path_.edge_count();
  const bool named = path_.light.emitter != scene::kNone;  // not of light from outside met by the eye's walk
  scene::EmissionSample start;
  start.vertex = path_.light;
  start.infinite = path_.light_infinite;
  start.ray = path_.light_delta_position ? Ray{path_.light.p, path_.along[0]}
                                         : spawn_ray(path_.light, path_.along[0]);
  std::uint32_t medium = named ? scene_.emitter_medium(start) : scene::kNone;
  if (named && path_.light_delta_position) {
    Ray ray = start.ray;
    scene::SurfaceHit hit;
    for (; scene_.intersect(ray, hit) && goes_through(hit, path_.light.p);
         ray = spawn_ray(hit, ray.direction))
      medium = scene_.medium_beyond(hit, ray.direction, medium);
  }
  for (std::size_t i = 0; i < k; ++i) {
    Edge& edge = edges_[i];
    for (std::size_t j = 0; j < edge.stretches.size(); ++j) {
      if (j > 0) medium = scene_.medium_beyond(edge.passes[j - 1].hit, path_.along[i], medium);
      edge.stretches[j].medium = medium;
    }
    if (i + 1 < k && path_.inner[i].kind == VertexKind::surface)
      medium = scene_.medium_beyond(path_.inner[i].hit, path_.along[i + 1], medium);
  }
  medium = scene_.camera_medium({path_.lens_near, -path_.along[k - 1]});
  for (std::size_t i = k; i-- > 0;) {
    Edge& edge = edges_[i];
    for (std::size_t j = edge.stretches.size(); j-- > 0;) {
      media_agree_ = media_agree_ && (!named || edge.stretches[j].medium == medium);
      edge.stretches[j].medium = medium;
      if (j > 0) medium = scene_.medium_beyond(edge.passes[j - 1].hit, -path_.along[i], medium);
      if (edge.stretches[j].medium == scene::kNone) continue;
      const scene::Medium& around = scene_.medium(edge.stretches[j].medium);
      if (around.homogeneous())
        numbers_.survival[i] *= mean(closed_transmittance(around, edge.stretches[j].length));
      else
        closed_form_ = false;
    }
    if (i == 0) break;
    const InnerVertex& v = path_.inner[i - 1];
    if (v.kind == VertexKind::surface)
      medium = scene_.medium_beyond(v.hit, -path_.along[i - 1], medium);
    else
      media_agree_ = media_agree_ && v.medium == medium;
  }
}

void Evaluation::evaluate_inner(std::size_t i) {
  const InnerVertex& v = path_.inner[i - 1];
  const Vec3 to_light = -path_.along[i - 1], to_eye = path_.along[i];
  PathNumbers& n = numbers_;
  Inner& x = inner_[i - 1];
  if (v.kind == VertexKind::medium) {
    const scene::Medium& medium = scene_.medium(v.medium);
    const Channels sigma_t = channels(medium.sigma_t(v.hit.p));
    n.in_medium[i] = true;
    n.medium[i] = v.medium;
    n.beam_sine[i] = length(cross(Vec3d(to_light), Vec3d(to_eye)));
    n.factor_to_eye[i] = n.factor_to_light[i] = std::max(mean(sigma_t), 1e-30);
    x.value = sigma_t;
    if (evaluate_turned(i, medium, to_light, to_eye)) return;
    n.pdf_to_eye[i] = static_cast<double>(medium.phase().pdf_solid_angle(to_light, to_eye));
    n.pdf_to_light[i] = static_cast<double>(medium.phase().pdf_solid_angle(to_eye, to_light));
    multiply(x.value, channels(medium.albedo(v.hit.p)),
             static_cast<double>(medium.phase().eval(to_eye, to_light)));
  } else {
    n.factor_to_eye[i] = cosine(to_eye, v.hit.ng);
    n.factor_to_light[i] = cosine(to_light, v.hit.ng);
    const Vec3 local_light = v.hit.shading.to_local(to_light), local_eye = v.hit.shading.to_local(to_eye);
    scene::ClosureArena arena_light, arena_eye;
    scene::Closure from_light = scene_.closure(v.hit, local_light, arena_light);
    scene::Closure from_eye = scene_.closure(v.hit, local_eye, arena_eye);
    // With edits that select by the path: the densities that both walks' weights know. Values are those of
    // the vertex alone.
    std::optional<scene::EditedWalk> light_walk, eye_walk;
    if (const scene::PathEdits* edits = scene_.objects().path_edits.get()) {
      light_walk.emplace(*edits, true);
      light_walk->begin_at_lamp(0);
      from_light = light_walk->surface(v.hit, from_light);
      eye_walk.emplace(*edits, true);
      eye_walk->begin_at_eye();
      from_eye = eye_walk->surface(v.hit, from_eye);
      eye_walk->towards_lamp(0);
    }
    x.scatters_through = from_eye.scatters_through();
    if (v.delta) {
      evaluate_delta(i, from_light, from_eye, local_light, local_eye);
      return;
    }
    if (v.cone != Cone::none) {
      evaluate_cone(i, from_light, from_eye);
      return;
    }
    n.pdf_to_eye[i] =
        static_cast<double>(from_light.pdf_solid_angle(local_light, local_eye, TransportMode::importance));
    float pdf = 0;
    x.value = channels(from_eye.eval_pdf(local_eye, local_light, TransportMode::radiance, pdf));
    n.pdf_to_light[i] = static_cast<double>(pdf);
  }
  x.prob_to_eye = n.pdf_to_eye[i];
  x.prob_to_light = n.pdf_to_light[i];
}

// A place in a medium whose light edits turn; as surfaces with edits.
bool Evaluation::evaluate_turned(std::size_t i, const scene::Medium& medium, Vec3 to_light, Vec3 to_eye) {
  const InnerVertex& v = path_.inner[i - 1];
  scene::ClosureArena arena_light, arena_eye;
  scene::Closure from_light, from_eye;
  std::optional<scene::EditedWalk> light_walk, eye_walk;
  if (const scene::PathEdits* edits = scene_.objects().path_edits.get()) {
    light_walk.emplace(*edits, true);
    light_walk->begin_at_lamp(0);
    if (!light_walk->medium(v.medium, medium.phase(), v.hit.p, from_light)) return false;
    eye_walk.emplace(*edits, true);
    eye_walk->begin_at_eye();
    eye_walk->medium(v.medium, medium.phase(), v.hit.p, from_eye);
    eye_walk->towards_lamp(0);
  } else {
    if (medium.edits() == nullptr) return false;
    if (!scene::edited_phase(*medium.edits(), medium.phase(), v.hit.p, arena_light, from_light)) return false;
    scene::edited_phase(*medium.edits(), medium.phase(), v.hit.p, arena_eye, from_eye);
  }
  const TurnedScattering light(from_light, to_light), eye(from_eye, to_eye);
  PathNumbers& n = numbers_;
  Inner& x = inner_[i - 1];
  n.pdf_to_eye[i] = static_cast<double>(light.pdf_solid_angle(to_eye, TransportMode::importance));
  float pdf = 0;
  multiply(x.value, channels(medium.albedo(v.hit.p)));
  multiply(x.value, channels(eye.value(to_light, TransportMode::radiance, pdf)));
  n.pdf_to_light[i] = static_cast<double>(pdf);
  x.prob_to_eye = n.pdf_to_eye[i];
  x.prob_to_light = n.pdf_to_light[i];
  return true;
}

void Evaluation::evaluate_delta(std::size_t i, const scene::Closure& from_light,
                                const scene::Closure& from_eye, Vec3 to_light, Vec3 to_eye) {
  const InnerVertex& v = path_.inner[i - 1];
  PathNumbers& n = numbers_;
  Inner& x = inner_[i - 1];
  const double known_light = v.delta_prob_from_light ? v.delta_prob : 0,
               known_eye = v.delta_prob_from_light ? 0 : v.delta_prob;
  const DeltaLobe light =
      find_delta(from_light, to_light, to_eye, TransportMode::importance, false, known_light);
  const DeltaLobe eye = find_delta(from_eye, to_eye, to_light, TransportMode::radiance, false, known_eye);
  const double squared = eye.eta * eye.eta;  // (n_light / n_eye)^2
  n.delta[i] = true;
  n.pdf_to_light[i] = eye.prob;
  n.pdf_to_eye[i] = light.prob / squared * n.factor_to_eye[i] / n.factor_to_light[i];
  x.prob_to_light = eye.prob;
  x.prob_to_eye = light.prob / squared * std::abs(static_cast<double>(to_eye.z)) /
                  std::abs(static_cast<double>(to_light.z));
  x.value = eye.value;
}

// No walk goes on from here: densities stay 0. The value is such that with the cosines and lengths of
// contribution() the edge has kappa K / l^2. [regularisation note, section 4]
void Evaluation::evaluate_cone(std::size_t i, const scene::Closure& from_light,
                               const scene::Closure& from_eye) {
  const InnerVertex& v = path_.inner[i - 1];
  const bool to_light = v.cone == Cone::towards_light;
  const Vec3 wo = to_light ? path_.along[i] : -path_.along[i - 1], local = v.hit.shading.to_local(wo),
             towards = to_light ? -path_.along[i - 1] : path_.along[i];
  const std::size_t edge = to_light ? i - 1 : i, other = to_light ? i - 1 : i + 1;
  const bool far =
      to_light ? i == 1 && path_.light_infinite : i + 1 == path_.edge_count() && path_.lens_infinite;
  const Vec3d way = far ? Vec3d(towards) * far_length(scene_) : place(other) - place(i);
  const TransportMode mode = to_light ? TransportMode::radiance : TransportMode::importance;
  const Mollifier mollifier(rules_.bandwidth);
  const double side = dot(way, Vec3d(v.hit.ng));
  Inner& x = inner_[i - 1];
  for (const scene::DeltaLobe& lobe : scene::delta_lobes(to_light ? from_eye : from_light, local, mode)) {
    const Vec3 wi = v.hit.shading.to_world(lobe.wi);
    if (lobe.passthrough || !(static_cast<double>(dot(wi, v.hit.ng)) * side > 0) ||
        !mollifier.inside(Vec3d(wi), way))
      continue;
    const double adjoint = to_light ? 1 : static_cast<double>(shading_correction(v.hit, wo, wi));
    const Channels kappa = channels(lobe.value);
    for (std::size_t c = 0; c < 3; ++c) x.value[c] += kappa[c] * adjoint;
  }
  const double l2 = length_squared(way), of_edge = far ? 1 : numbers_.distance_squared[edge];
  double scale = mollifier.value_over_length_squared(l2) * (far ? l2 : of_edge);
  if (!to_light) scale *= numbers_.factor_to_light[i] / numbers_.factor_to_eye[i];
  for (double& value : x.value) value *= scale;
}

void Evaluation::evaluate_light() {
  PathNumbers& n = numbers_;
  const bool delta = path_.light_delta_position || path_.light_delta_direction;
  const bool on_surface = !path_.light_infinite && !delta;
  n.light_can_be_hit = !delta;
  if (on_surface) n.factor_to_eye[0] = cosine(path_.along[0], path_.light.ng);
  emitted_ = channels(delta                  ? path_.light_delta_radiance
                      : path_.light_infinite ? scene_.environment(-path_.along[0])
                                             : scene_.emitted(path_.light, path_.along[0]));

  // P_0, and the density of the light's walk's direction.
  scene::EmissionDensity emission;
  bool emits = false;
  scene::DirectSample seen;
  seen.wi = -path_.along[0];
  seen.emitter = path_.light.emitter;
  seen.p = path_.light.p;
  if (on_surface)
    emits = scene_.pdf_emission(path_.light, path_.along[0], emission);
  else if (delta)
    emits = scene_.pdf_emission(seen, emission);
  else
    emits = scene_.pdf_emission_environment(-path_.along[0], emission);
  if (!emits) return;
  const auto prob = static_cast<double>(emission.prob), area = static_cast<double>(emission.pdf_area),
             angle = static_cast<double>(emission.pdf_solid_angle);
  n.light_prob = prob * (path_.light_infinite ? angle : area);
  n.pdf_to_eye[0] = path_.light_infinite ? area : angle;
}

// C_0.
void Evaluation::evaluate_light_direct() {
  PathNumbers& n = numbers_;
  const bool delta = path_.light_delta_position || path_.light_delta_direction;
  const InnerVertex& first = path_.inner[0];
  Vec3 front;
  if (first.kind == VertexKind::surface && !inner_[0].scatters_through)
    front = dot(path_.along[1], first.hit.shading.n) < 0 ? -first.hit.shading.n : first.hit.shading.n;
  if (delta)
    n.light_direct = static_cast<double>(scene_.prob_direct(first.hit, front, path_.light.emitter));
  else if (path_.light_infinite)
    n.light_direct =
        static_cast<double>(scene_.pdf_direct_environment_solid_angle(first.hit, front, -path_.along[0]));
  else
    n.light_direct =
        static_cast<double>(scene_.pdf_direct_solid_angle(first.hit, front, -path_.along[0], path_.light)) *
        n.factor_to_eye[0] / n.distance_squared[0];
}

// Q_k, C_k, and the density of the eye's walk's direction.
bool Evaluation::evaluate_sensor() {
  const std::size_t k = path_.edge_count();
  PathNumbers& n = numbers_;
  scene::CameraDensity camera;
  if (!scene_.pdf_camera(path_.lens_near, -path_.along[k - 1], camera, rules_.film_border)) return false;
  n.lens_can_be_hit = !camera.delta_position && !camera.delta_direction;
  n.lens_prob = camera.delta_direction ? 1 : static_cast<double>(camera.pdf_area);
  n.lens_connect = n.lens_prob;
  n.factor_to_light[k] = static_cast<double>(camera.cosine);
  n.pdf_to_light[k] = rules_.eye_paths *
                      static_cast<double>(camera.delta_direction ? camera.pdf_area : camera.pdf_solid_angle);
  importance_ = static_cast<double>(camera.importance) *
                (camera.delta_position ? 1 : static_cast<double>(camera.cosine));
  return true;
}

}  // namespace candela::transport::path
