// The random walk that makes subpaths, from the eye or from the light, vertex by vertex:
//
//   walk.start_eye(ray) or walk.start_light();
//   while (walk.advance(v, arena) == Event::vertex) {   // v is where it arrived
//     ... use v ...
//     if (walk.scatter(v) == Step::ended) break;         // where it goes on to
//   }
//
// Estimators do not write this loop: eye_path.h and light_path.h have it.
//
// Between two vertices it may pass surfaces straight and cross media. A surface passed straight is no vertex
// of the path, but its other lobes scatter: advance() stops there, v may be connected, and if scatter() says
// `passed` the next vertex counts from the one before.
//
// Weights: each vertex gets the block of the policy Mis on arrival (mis/). At a delta lobe the two densities
// are discrete, of choosing it, and only their quotient matters, which must be the inverse of what a walk the
// other way has: prob_reverse / prob / eta^2, eta^2 for the solid angles that refraction narrows (their ratio
// is eta^2 cos / cos, and the cosines cancel those of the area densities).
//
// Random numbers: draws.h. Stretches of media that the walk crosses are shown to an Observer (segments.h).
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <limits>

#include "common/film/counts.h"
#include "worker/core/measure.h"
#include "worker/samplers/sampler.h"
#include "worker/scene/bsdfs/edited.h"
#include "worker/transport/between.h"
#include "worker/transport/draws.h"
#include "worker/transport/roulette.h"
#include "worker/transport/rules.h"
#include "worker/transport/segments.h"
#include "worker/transport/vertex.h"

namespace candela::transport {

// The density with which next event estimation at `hit`, the first vertex of a light path from o, would have
// chosen the light's point, in the measure of the light walk's own. front, wo: as ScatterPoint's;
// distance_squared: between them.
inline double direct_density(const scene::Scene& scene, const scene::EmissionSample& o, const SurfaceHit& hit,
                             Vec3 front, Vec3 wo, double distance_squared) {
  if (o.delta_position || o.delta_direction)
    return static_cast<double>(scene.prob_direct(hit, front, o.vertex.emitter));
  if (o.infinite) return static_cast<double>(scene.pdf_direct_environment_solid_angle(hit, front, wo));
  return solid_angle_to_area(static_cast<double>(scene.pdf_direct_solid_angle(hit, front, wo, o.vertex)),
                             static_cast<double>(o.cosine), distance_squared);
}

// The parameters of a walk. SamplerT: samplers::Sampler, or what stands in for it (mcmc::PrimarySampler).
// ObserverT: as NoObserver; a handle, kept by value.
template <TransportMode kModeOf, EdgeContent kEdgeContentOf, class MisT, class SamplerT = samplers::Sampler,
          class ObserverT = NoObserver>
struct WalkConfig {
  static constexpr TransportMode kMode = kModeOf;
  static constexpr EdgeContent kEdgeContent = kEdgeContentOf;
  using Mis = MisT;
  using Sampler = SamplerT;
  using Observer = ObserverT;
};

// Config: a WalkConfig, or a type with its members.
template <class Config>
class BasicWalk {
 public:
  static constexpr TransportMode kMode = Config::kMode;
  static constexpr EdgeContent kEdgeContent = Config::kEdgeContent;
  using Mis = typename Config::Mis;
  using SamplerT = typename Config::Sampler;
  using Observer = typename Config::Observer;
  using Block = typename Mis::Block;
  using Vertex = transport::Vertex<Block>;
  using Departure = typename Mis::Departure;
  static constexpr EdgeContent kContent = kEdgeContent;
  enum class Event : std::uint8_t { vertex, left, ended };
  enum class Step : std::uint8_t { scattered, passed, ended };
  static constexpr bool kFromLight = kMode == TransportMode::importance;
  static constexpr bool kPasses = kEdgeContent != EdgeContent::nothing,
                        kMedia = kEdgeContent == EdgeContent::media;

  BasicWalk(const scene::Scene& scene, const WalkRules& rules, const MisFactors& factors, SamplerT& sampler,
            film::SampleCounts& sample_counts, Observer observer = {})
      : scene_(scene),
        rules_(rules),
        factors_(factors),
        sampler_(sampler),
        sample_counts_(sample_counts),
        observer_(observer) {}

  // Draws dimensions [0, kLightDimensions). False: no light by this choice.
  bool start_light();
  // Along a ray of Scene::camera_ray, through the film at any place that pdf_camera knows.
  void start_eye(const Ray& ray);

  // On to the next vertex. `vertex`: where the walk may scatter, or only what emits: one at max_edges has no
  // closure unless it passes light on, and one beyond is only made on the way to the lens, where light may go
  // straight on: it has no closure and is not connectible. `left`: out of the scene; v has
  // throughput, wo, edges and what weights need. `ended`: absorbed.
  Event advance(Vertex& v, scene::ClosureArena& arena);
  // Chooses the direction from v, which advance() just filled.
  Step scatter(Vertex& v);

  const scene::EmissionSample& origin() const { return origin_; }
  // True if draws at this vertex should be stratified.
  bool stratified() const { return scatterings_ < kStratifiedVertices; }
  // The random numbers of the present vertex.
  VertexDraws<SamplerT> draws() const { return {sampler_, block_, stratified()}; }
  // Names the path among all of its sampler.
  std::uint64_t sample_key() const { return sampler_.sample_key(); }

  // Direction in which the last scatter() left its vertex.
  Vec3 direction() const { return ray_.direction; }

  // Place where the last advance() met the lens; light walks only.
  struct LensMeeting {
    bool met = false;
    scene::CameraDensity camera;
    Spectrum throughput;
    std::uint32_t edges = 0;
    float distance = 0;   // from the last surface passed
    double survival = 1;  // of the edge up to the lens
  };
  const LensMeeting& lens() const { return lens_; }
  // The edge under way, and where it began.
  const Departure& departure() const { return departure_; }
  Vec3 from() const { return from_; }
  bool from_finite() const { return finite_; }  // false: light from outside
  double origin_density() const { return origin_density_; }

 private:
  // Vertices of more edges do not scatter.
  std::uint32_t max_edges() const { return rules_.max_edges + (kFromLight && rules_.meets_lens ? 1 : 0); }
  void arrive(Vertex& v);
  void depart(Vertex& v, float pdf, bool delta, double pdf_reverse, double factor_out);
  // `longest`: of the probability.
  bool survives(float longest);
  // The direction from a place in a medium whose light edits turn. False: the walk ends.
  [[gnu::noinline]] bool sample_turned(const Vertex& v, Vec3& wi, float& pdf, float& pdf_reverse);
  // The walk is as bright as one that roulette lets live, but has too many edges.
  void note_bound() {
    if (bounded_ || edges_ < rules_.rr_depth) return;
    bounded_ = true;
    ++sample_counts_.bounded_walks;
  }
  bool leave_surfaces(bool found, SurfaceHit& hit);
  bool pass_through(const SurfaceHit& hit);
  void look_for_lens(bool found, const SurfaceHit& hit);

  const scene::Scene& scene_;
  const WalkRules& rules_;
  const MisFactors& factors_;
  SamplerT& sampler_;
  film::SampleCounts& sample_counts_;
  [[no_unique_address]] Observer observer_;

  Ray ray_;
  Spectrum throughput_;
  float scale_ = 1;  // undoes the start's size, and radiance's 1/eta^2, for the roulette
  std::uint32_t medium_ = scene::kNone;
  std::uint32_t edges_ = 0;  // of the last vertex that scattered
  std::uint32_t scatterings_ = 0;
  std::uint32_t block_ = 0;
  std::uint32_t passes_ = 0;
  bool first_stretch_ = true;
  bool bounded_ = false;  // and counted as that
  Vec3 from_;             // that vertex's place, the start's
  bool finite_ = true;    // it has one
  double survival_ = 1;   // of the edge so far
  [[no_unique_address]] Departure departure_;
  double origin_density_ = 1;  // of the end point alone
  scene::EmissionSample origin_;
  LensMeeting lens_;
};

// A walk by its parameters one by one.
template <TransportMode kMode, EdgeContent kEdgeContent, class Mis, class SamplerT = samplers::Sampler,
          class Observer = NoObserver>
using Walk = BasicWalk<WalkConfig<kMode, kEdgeContent, Mis, SamplerT, Observer>>;

template <class Config>
bool BasicWalk<Config>::start_light() {
  const float u_select = sampler_.draw_1d(0, true);
  const Vec2 u_position = sampler_.draw_2d(1, true), u_direction = sampler_.draw_2d(2, true);
  if (!scene_.sample_emission(u_select, u_position, u_direction, origin_)) return false;
  ray_ = origin_.ray;
  throughput_ = origin_.weight;
  if constexpr (kMedia) {
    medium_ = scene_.emitter_medium(origin_);
    if (origin_.infinite && medium_ != scene::kNone) {
      // It came through all of the medium outside, which takes everything unless it ends somewhere.
      rng::Stream stream(
          rng::key(std::bit_cast<std::uint32_t>(u_direction.x), std::bit_cast<std::uint32_t>(u_direction.y)));
      throughput_ *= scene_.medium(medium_).transmittance({ray_.origin, -ray_.direction}, stream);
      if (throughput_.is_black()) return false;
    }
  }
  scale_ = 1 / throughput_.max_component();
  block_ = kLightDimensions;
  from_ = origin_.vertex.p;
  finite_ = !origin_.infinite;
  if constexpr (Mis::kWeighs) {
    const double prob = static_cast<double>(origin_.prob), area = static_cast<double>(origin_.pdf_area),
                 angle = static_cast<double>(origin_.pdf_solid_angle);
    origin_density_ = prob * (finite_ ? area : angle);
    departure_ = Mis::leave_end(factors_.hit_light, origin_density_,
                                !origin_.delta_position && !origin_.delta_direction, finite_ ? angle : area,
                                finite_ ? static_cast<double>(origin_.cosine) : 1.0);
  }
  return true;
}

template <class Config>
void BasicWalk<Config>::start_eye(const Ray& ray) {
  ray_ = ray;
  throughput_ = Spectrum(1.0f);
  if constexpr (kMedia) medium_ = scene_.camera_medium(ray);
  block_ = kEyeDimensions;
  finite_ = true;
  from_ = ray.origin;
  if constexpr (Mis::kWeighs) {
    scene::CameraDensity camera;
    departure_ = {};
    // A ray at the film's rim may be off it by rounding: then no other technique finds its path.
    if (!scene_.pdf_camera(ray.origin, ray.direction, camera, rules_.film_border)) return;
    from_ = camera.p;
    finite_ = !camera.delta_direction;
    const auto pdf = static_cast<double>(camera.delta_direction ? camera.pdf_area : camera.pdf_solid_angle);
    departure_ = Mis::leave_end(factors_.hit_lens, static_cast<double>(camera.pdf_area),
                                !camera.delta_position && !camera.delta_direction, rules_.eye_paths * pdf,
                                static_cast<double>(camera.cosine));
  }
}

template <class Config>
auto BasicWalk<Config>::advance(Vertex& v, scene::ClosureArena& arena) -> Event {
  const bool from_outside = kFromLight && first_stretch_ && !finite_;
  if (first_stretch_)
    first_stretch_ = false;
  else
    block_ += kBlock;
  ++sample_counts_.rays;
  bool found = scene_.intersect(ray_, v.hit);
  if constexpr (kFromLight) {
    if (edges_ == 0 && origin_.delta_position) found = leave_surfaces(found, v.hit);
    lens_.met = false;
    if (rules_.meets_lens && edges_ > 0) look_for_lens(found, v.hit);
  }
  v.wo = -ray_.direction;
  v.edges = edges_ + 1;
  if constexpr (kFromLight)
    v.lit_by_delta = edges_ == 0 && (origin_.delta_position || origin_.delta_direction);
  if constexpr (Mis::kWeighs) v.pdf_reverse = 0;
  // One more edge than max_edges is for the lens alone, which may stand behind what light passes straight.
  const bool for_lens = kFromLight && v.edges > rules_.max_edges;
  if (for_lens && (!kPasses || !found)) return Event::ended;

  if constexpr (kMedia) {
    if (medium_ != scene::kNone) {
      const scene::Medium& around = scene_.medium(medium_);
      Ray stretch = inside_medium(ray_, found ? &v.hit : nullptr);
      observer_.stretch({stretch, medium_, throughput_, survival_, v.edges});
      const scene::DistanceSample flight = around.sample_distance(
          stretch, throughput_, sampler_.draw_2d(block_ + kFlight, stratified()), observer_.steps());
      throughput_ *= flight.weight;
      // Light got as far as the flight, even if nothing scatters at its end.
      if (flight.scattered)
        observer_.scattered(flight.distance);
      else
        observer_.survived();
      if (throughput_.is_black()) return Event::ended;
      if (flight.scattered) stretch.t_max = flight.distance;
      if (from_outside) stretch.t_max = Ray().t_max;  // as the eye's walk sees that edge
      if constexpr (Mis::kWeighs) survival_ *= static_cast<double>(stretch_survival(around, stretch));
      if (flight.scattered) {
        if (for_lens || (v.edges >= rules_.max_edges && !kFromLight))
          return Event::ended;  // light cannot come from it, or not go on
        v.kind = VertexKind::medium;
        medium_vertex(ray_, flight.distance, v.hit);
        v.medium = medium_;
        v.connectible = true;
        v.front = {};
        v.arrival = hazard_of(around.sigma_t(v.hit.p));
        v.turned = around.edits() != nullptr &&
                   scene::edited_phase(*around.edits(), around.phase(), v.hit.p, arena, v.closure);
        v.throughput = throughput_;
        arrive(v);
        return Event::vertex;
      }
    }
  }
  v.medium = medium_;
  v.throughput = throughput_;
  v.kind = VertexKind::surface;
  if (!found) {
    v.arrival = 1;
    v.connectible = false;
    if constexpr (Mis::kWeighs) {
      finite_ = false;
      arrive(v);
    }
    return Event::left;
  }
  v.arrival = v.density_factor(v.wo);
  v.connectible = false;
  v.closure.black = true;
  if (v.edges < rules_.max_edges || (kFromLight && !for_lens)) {
    const Vec3 wo = v.hit.shading.to_local(v.wo);
    arena.clear();
    v.closure = scene_.closure(v.hit, wo, arena);
    v.connectible = !v.closure.black && !v.closure.purely_delta();
    v.front = SurfaceScattering(v.hit, v.closure, v.wo, wo).front();
  }
  arrive(v);
  return Event::vertex;
}

// A point or spot light may lie on a surface (a spot in a ceiling): next event estimation does not meet that,
// and neither does its walk, which then goes on from behind it.
template <class Config>
bool BasicWalk<Config>::leave_surfaces(bool found, SurfaceHit& hit) {
  while (found && goes_through(hit, origin_.vertex.p)) {
    if constexpr (kMedia) medium_ = scene_.medium_beyond(hit, ray_.direction, medium_);
    ray_ = spawn_ray(hit, ray_.direction);
    if (++passes_ >= kMaxPasses) return false;
    ++sample_counts_.rays;
    found = scene_.intersect(ray_, hit);
  }
  return found;
}

// Adds the numbers of an edge that ends at v, which weights need.
template <class Config>
void BasicWalk<Config>::arrive(Vertex& v) {
  if constexpr (Mis::kWeighs) {
    const Departure& d = departure_;
    const double at_v = static_cast<double>(v.arrival);
    const double distance_squared = finite_ ? length_squared(Vec3d(v.hit.p) - Vec3d(from_)) : 1;
    const double spread = survival_ / std::max(distance_squared, std::numeric_limits<double>::min());
    v.previous_connects = d.connects > 0;
    v.pdf_arrival = d.pdf * survival_;
    v.pdf_area = solid_angle_to_area_by_spread(d.pdf, spread, at_v);
    v.back_area = spread * d.leave * d.pdf;
    v.survival = static_cast<float>(survival_);
    v.mis = {};
    if (!(d.pdf > 0)) return;
    if (edges_ > 0) {
      v.mis = Mis::arrive_later(d, factors_, at_v, v.pdf_area, v.on_surface(), survival_);
    } else if constexpr (kFromLight) {
      const double direct =
          v.connectible ? direct_density(scene_, origin_, v.hit, v.front, v.wo, distance_squared) : 0;
      v.mis = Mis::arrive_from_light(d, factors_, at_v, v.pdf_area, direct, origin_density_);
    } else {
      v.mis = Mis::arrive_from_eye(d, factors_, at_v, v.pdf_area, survival_);
    }
  }
}

template <class Config>
void BasicWalk<Config>::depart(Vertex& v, float pdf, bool delta, double pdf_reverse, double factor_out) {
  edges_ = v.edges;
  from_ = v.hit.p;
  finite_ = true;
  survival_ = 1;
  v.left_by_delta = delta;
  if constexpr (Mis::kWeighs) {
    v.pdf_reverse = pdf_reverse;
    departure_ = Mis::leave_vertex(v.mis, v.kind == VertexKind::surface, delta, static_cast<double>(pdf),
                                   pdf_reverse, factor_out);
  }
}

template <class Config>
auto BasicWalk<Config>::scatter(Vertex& v) -> Step {
  const bool stratify = stratified();
  if constexpr (kMedia) {
    if (v.kind == VertexKind::medium) {
      if (v.edges >= max_edges()) return Step::ended;
      Vec3 wi;
      float pdf = 0, reverse = 0;
      if (v.turned) [[unlikely]] {
        if (!sample_turned(v, wi, pdf, reverse)) return Step::ended;
      } else {
        pdf = reverse = MediumScattering(scene_.medium(v.medium).phase(), v.wo)
                            .sample(sampler_.draw_2d(block_ + kDirection, stratify), wi);
      }
      ++scatterings_;
      v.left_sharply = pdf > kSharpDensity;
      depart(v, pdf, false, static_cast<double>(reverse), static_cast<double>(v.arrival));
      if constexpr (Mis::kMergesBeams)
        Mis::add_merges(departure_,
                        Mis::leaving(factors_.medium[v.medium], kFromLight, v.arrival, v.wo, wi, v.survival));
      if (edges_ >= kLongestWalk && kSubpathRoulette.binds(throughput_.max_component() * scale_))
        note_bound();
      if (!survives(longest_survival_in_media(edges_))) return Step::ended;
      ray_ = {v.hit.p, wi};
      return Step::scattered;
    }
  }
  if (v.edges >= max_edges()) {
    if constexpr (kPasses) {  // light may still arrive straight through
      throughput_ *= scene_.passthrough(v.hit, kFromLight ? -v.wo : v.wo);  // as the viewer sees it
      if (!throughput_.is_black() && pass_through(v.hit)) return Step::passed;
    }
    return Step::ended;
  }
  if (v.closure.black) return Step::ended;
  const SurfaceScattering at(v.hit, v.closure, v.wo);
  scene::BsdfSample next;
  const float u_lobe = at.chooses_lobe() ? sampler_.draw_1d(block_ + kLobe, stratify) : 0.0f;
  if (!at.sample(u_lobe, sampler_.draw_2d(block_ + kDirection, stratify), kMode, next)) return Step::ended;
  throughput_ *= next.weight;
  if constexpr (kPasses) {
    if (next.passthrough) return !throughput_.is_black() && pass_through(v.hit) ? Step::passed : Step::ended;
  }
  const Vec3 wi = at.direction(next);
  if constexpr (kFromLight)
    throughput_ *= at.adjoint(wi);
  else
    scale_ *= next.eta * next.eta;
  if (throughput_.is_black()) return Step::ended;
  scatterings_ += v.closure.purely_delta() ? 0 : 1;

  v.left_sharply = next.delta || next.pdf_solid_angle > kSharpDensity;
  double reverse = 0, out = 0;
  float pdf = 1;
  if constexpr (Mis::kWeighs) {
    out = static_cast<double>(v.density_factor(wi));
    if (next.delta) {
      pdf = next.prob;
      const double eta = static_cast<double>(next.eta);
      reverse = static_cast<double>(next.prob_reverse) / (eta * eta) * static_cast<double>(v.arrival) / out;
    } else {
      pdf = next.pdf_solid_angle;
      reverse = static_cast<double>(at.pdf_reverse_solid_angle(next, kMode));
    }
  }
  depart(v, pdf, next.delta, reverse, out);
  const bool bright = !next.delta && throughput_.max_component() * scale_ > 1,
             free = bright && edges_ < kSubpathRoulette.free_depth;
  if (bright && !free) [[unlikely]]
    note_bound();
  if (!survives(free ? 1.0f : kMaxSurvival)) return Step::ended;
  ray_ = spawn_ray(v.hit, wi);
  if constexpr (kMedia) medium_ = scene_.medium_beyond(v.hit, ray_.direction, medium_);
  return Step::scattered;
}

template <class Config>
bool BasicWalk<Config>::sample_turned(const Vertex& v, Vec3& wi, float& pdf, float& pdf_reverse) {
  const TurnedScattering at(v.closure, v.wo);
  scene::BsdfSample next;
  const float u_lobe = at.chooses_lobe() ? sampler_.draw_1d(block_ + kLobe, stratified()) : 0.0f;
  if (!at.sample(u_lobe, sampler_.draw_2d(block_ + kDirection, stratified()), kMode, next)) return false;
  throughput_ *= next.weight;
  if (throughput_.is_black()) return false;
  wi = next.wi;
  pdf = next.pdf_solid_angle;
  pdf_reverse = at.pdf_reverse_solid_angle(wi, kMode);
  return true;
}

template <class Config>
bool BasicWalk<Config>::survives(float longest) {
  if (edges_ < rules_.rr_depth) return true;
  const float survive = kSubpathRoulette.survival(throughput_.max_component() * scale_, longest);
  if (!(sampler_.draw_1d(block_ + kRoulette, stratified()) < survive)) return false;
  throughput_ *= 1 / survive;
  return true;
}

template <class Config>
bool BasicWalk<Config>::pass_through(const SurfaceHit& hit) {
  if constexpr (kMedia) medium_ = scene_.medium_beyond(hit, ray_.direction, medium_);
  ray_ = spawn_ray(hit, ray_.direction);
  return ++passes_ < kMaxPasses;
}

// The lens does not stop the walk, and it is met whether or not a flight through a medium would have got
// there: what a medium takes is in the throughput instead.
template <class Config>
void BasicWalk<Config>::look_for_lens(bool found, const SurfaceHit& hit) {
  float distance = 0;
  if (!scene_.meets_camera(ray_, found ? &hit : nullptr, distance, lens_.camera, rules_.film_border)) return;
  lens_.met = true;
  lens_.throughput = throughput_;
  lens_.edges = edges_ + 1;
  lens_.distance = distance;
  lens_.survival = survival_;
  if constexpr (kMedia) {
    if (medium_ != scene::kNone) {
      const Vec2 u = sampler_.draw_2d(block_ + kLensFlight, false);
      rng::Stream stream(rng::key(std::bit_cast<std::uint32_t>(u.x), std::bit_cast<std::uint32_t>(u.y)));
      const Ray stretch{ray_.origin, ray_.direction, distance};
      lens_.throughput *= scene_.medium(medium_).transmittance(stretch, stream);
      if (lens_.throughput.is_black()) lens_.met = false;
      if constexpr (Mis::kWeighs)
        lens_.survival = survival_ * static_cast<double>(stretch_survival(scene_.medium(medium_), stretch));
    }
  }
}

}  // namespace candela::transport
