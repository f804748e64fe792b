// Path tracing. A path of depth d has d edges from the camera to the emitter, whose ends scatter. At each
// vertex light is gathered in two ways: a direction sampled towards an emitter, and the direction that the
// path goes on in should it meet one. Both estimate the same integral; each contribution is weighted by the
// heuristic from the two solid-angle densities at the vertex.
//
// Between two vertices light may pass surfaces straight and cross media (between.h). Neither turns it, so
// that the densities of its direction at the vertex stay what they were, and so do the weights: they depend
// on the vertex, the direction and the emitter alone, not on what chance decided along the way. A flight
// through a medium may end in a vertex of its own, which scatters by the phase function.
//
// throughput: product of scattering values times cosines over densities, along the path so far.
// Random numbers: path_block of transport/draws.h. A draw that nothing at the vertex reads is not made.
//
// Russian roulette from rr_depth on: kPathRoulette. A path survives with 4 times the probability Mitsuba
// gives it. Where light is hard to find, what a few long paths bring is most of the variance, and ending them
// early with their survivors scaled up makes it worse; where it is easy, long paths are only time. The bound
// on the probability does not hold in media either: in a cloud that absorbs nothing the lengths of paths fall
// off as slowly as n^-3/2, and a bound's survivors, scaled up, would carry light in samples too rare to come
// up.
//
// Why this is not transport::Walk (docs/decisions/005): on the scenes of tests/bench/guard.py the common
// walk, even without weights, takes 6 and 7 % more instructions. Its last edge also crosses media by a
// flight, not by their transmittance, and its random block is longer. Both share draws.h and roulette.h.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <optional>
#include <type_traits>

#include "common/film/counts.h"
#include "worker/estimators/first_vertex.h"
#include "worker/estimators/options.h"
#include "worker/samplers/sampler.h"
#include "worker/scene/bsdfs/edited.h"
#include "worker/scene/bsdfs/path_edited.h"
#include "worker/scene/emitters/light_groups.h"
#include "worker/scene/emitters/lights.h"
#include "worker/scene/scene.h"
#include "worker/transport/between.h"
#include "worker/transport/dense_medium.h"
#include "worker/transport/draws.h"
#include "worker/transport/letters/layer_sums.h"
#include "worker/transport/pair_weight.h"
#include "worker/transport/roulette.h"
#include "worker/transport/scattering.h"
#include "worker/transport/technique/contribution.h"
#include "worker/transport/technique/mollify.h"

namespace candela::estimators {

struct Mollification {
  transport::Mollifier by;
  Spectrum sum;  // of mollified paths
};
// In its place: nothing is mollified.
struct NoMollifier {};

// One path. Of the techniques it knows next_event and hit_light; where both run they are weighted.
// SceneT is scene::Scene, or what stands in for it to watch the rays. SamplerT likewise: samplers::Sampler,
// or a chain's. FirstT: FirstVertex, if it has techniques of its own there. With groups of lights next event
// estimation draws a point, and traces a shadow ray, for each of them
// (docs/integrators/path.md, "Shadow rays"). With a mollifier delta lobes are connected to lights that no ray
// meets (transport/regularise.h). kEdits: with edits that select by more of the path than the vertex, whose
// walk, at its start, is the constructor's last argument.
template <transport::EdgeContent kEdgeContent, class SceneT, class SamplerT, class FirstT = NoFirstVertex,
          bool kLetters = false, bool kMollifies = false, bool kEdits = false>
class PathTracer {
 public:
  PathTracer(const SceneT& scene, const PathOptions& options, const Techniques& techniques, SamplerT& sampler,
             film::SampleCounts& sample_counts, FirstT* first = nullptr,
             const scene::LightGroups* groups = nullptr, transport::EyeLetters* letters = nullptr,
             scene::EditedWalk* edits = nullptr)
      : scene_(scene),
        options_(options),
        hit_light_(techniques.hit_light),
        next_event_(techniques.next_event),
        weighs_(techniques.hit_light && techniques.next_event),
        power_(options.heuristic == transport::MisHeuristic::power),
        chooses_emitter_(transport::reads_emitter_choice(scene)),
        lamps_are_surfaces_(!scene.features().any_delta_emitter),
        sampler_(sampler),
        sample_counts_(sample_counts),
        first_(first),
        groups_(groups),
        letters_(letters),
        edits_(edits) {}

  void mollify(const transport::Mollifier& mollifier) { mollified_.by = mollifier; }
  // The radiance of mollified paths.
  Spectrum mollified() const { return mollified_.sum; }

  // The radiance arriving along `ray`.
  Spectrum radiance(const Ray& ray) {
    ray_ = ray;
    if constexpr (kMedia) medium_ = scene_.camera_medium(ray);
    // An iteration is a stretch of a ray up to the next surface or scattering. depth_ counts edges between
    // vertices that scatter: passing straight does not.
    while (depth_ <= options_.max_depth && follow_stretch())
      block_ += kMedia ? transport::path_block::kMediaBlock : transport::path_block::kBlock;
    sample_counts_.rays += rays_;
    return sum_;
  }

 private:
  static constexpr bool kPasses = kEdgeContent != transport::EdgeContent::nothing,
                        kMedia = kEdgeContent == transport::EdgeContent::media;
  static constexpr bool kFirst = FirstT::kActive;
  static constexpr bool kGroups = std::is_same_v<SceneT, scene::Scene>;
  static constexpr scene::TransportMode kMode = scene::TransportMode::radiance;
  static constexpr scene::LightTechnique kChoice = scene::LightTechnique::adapted;
  enum class Flight : std::uint8_t { absorbed, scattered, arrived };

  float draw_1d(std::uint32_t which) { return sampler_.draw_1d(block_ + which, stratified_); }
  Vec2 draw_2d(std::uint32_t which) { return sampler_.draw_2d(block_ + which, stratified_); }

  // False: the path ends. So for all functions of steps.
  bool follow_stretch() {
    scene::SurfaceHit& hit = hits_[depth_ & 1];
    stratified_ = scatterings_ < transport::kStratifiedVertices;
    if constexpr (kMedia) {
      if (medium_ != scene::kNone && depth_ < options_.max_depth && in_dense_medium()) {
        if (const std::optional<bool> goes_on = fly_first(hit)) return *goes_on;
      }
    }
    ++rays_;
    const bool found = scene_.intersect(ray_, hit);
    if constexpr (kMedia) {
      if (medium_ != scene::kNone) {
        const Flight flight = fly(found ? &hit : nullptr);
        if (flight == Flight::absorbed) return false;
        if (flight == Flight::scattered) return scatter_in_medium(hit);
      }
    }
    if (!found) {
      if (hit_light_ && depth_ >= options_.min_edges) add_environment();
      return false;
    }
    if (hit_light_ && hit.emitter != scene::kNone && depth_ >= options_.min_edges) add_emitted(hit);
    if (depth_ == options_.max_depth) {  // light may still arrive straight through
      if constexpr (kPasses) {
        throughput_ *= scene_.passthrough(hit, -ray_.direction);
        return !throughput_.is_black() && pass_through(hit);
      }
      return false;
    }
    return scatter(hit);
  }

  bool in_dense_medium() const {
    return transport::is_dense(scene_.medium(medium_), scene_.features().radius);
  }
  // Draws the flight before the ray is traced, which need not be longer then, and scatters if there is no
  // surface on the way. Nothing: there may be one.
  std::optional<bool> fly_first(scene::SurfaceHit& hit) {
    const scene::DistanceSample flight =
        scene_.medium(medium_).sample_distance(ray_, throughput_, draw_2d(transport::path_block::kFlight));
    if (!flight.scattered) return std::nullopt;
    // The medium ends before the next surface by its error over the cosine (inside_medium).
    Ray ray = ray_;
    ray.t_max = std::min(ray.t_max, flight.distance + transport::kEndOfMedium * scene_.features().radius);
    if (!(ray.t_max < ball_.clearance())) {
      ++rays_;
      if (scene_.intersect(ray, hit)) return std::nullopt;
    }
    throughput_ *= flight.weight;
    if (throughput_.is_black()) return false;
    transport::medium_vertex(ray_, flight.distance, hit);
    return scatter_in_medium(hit);
  }

  // A flight through the medium up to the surface, or to a scattering before.
  Flight fly(const scene::SurfaceHit* surface) {
    const scene::Medium& around = scene_.medium(medium_);
    const Ray stretch = transport::inside_medium(ray_, surface);
    const Vec2 u = draw_2d(transport::path_block::kFlight);
    scene::DistanceSample flight;
    if (depth_ < options_.max_depth) {
      flight = around.sample_distance(stretch, throughput_, u);
    } else {  // nothing may scatter any more
      rng::Stream stream(rng::key(std::bit_cast<std::uint32_t>(u.x), std::bit_cast<std::uint32_t>(u.y)));
      flight.weight = around.transmittance(stretch, stream);
    }
    throughput_ *= flight.weight;
    if (throughput_.is_black()) return Flight::absorbed;
    if (!flight.scattered) return Flight::arrived;
    transport::medium_vertex(ray_, flight.distance, hits_[depth_ & 1]);
    return Flight::scattered;
  }

  bool scatter_in_medium(const scene::SurfaceHit& here) {
    const scene::Medium& around = scene_.medium(medium_);
    if constexpr (kEdits) {
      scene::Closure turned;
      if (edits_->medium(medium_, around.phase(), here.p, turned)) return scatter_turned(here, turned);
    } else if (around.edits() != nullptr) [[unlikely]] {
      scene::Closure turned;
      if (scene::edited_phase(*around.edits(), around.phase(), here.p, arena_, turned))
        return scatter_turned(here, turned);
    }
    const transport::MediumScattering at(around.phase(), -ray_.direction);
    return scatter_from_medium(
        here,
        [&](Vec3 wi, float& pdf_solid_angle) {
          Spectrum value = at.value(wi, kMode, pdf_solid_angle);
          if constexpr (kEdits) value *= edits_->medium_share();
          return value;
        },
        [&] {
          previous_pdf_solid_angle_ = at.sample(draw_2d(transport::path_block::kDirection), ray_.direction);
          return true;
        });
  }

  // The same if edits turn the light there.
  [[gnu::noinline]] bool scatter_turned(const scene::SurfaceHit& here, const scene::Closure& closure) {
    const transport::TurnedScattering at(closure, -ray_.direction);
    return scatter_from_medium(
        here, [&](Vec3 wi, float& pdf_solid_angle) { return at.value(wi, kMode, pdf_solid_angle); },
        [&] {
          scene::BsdfSample next;
          const float u_lobe = at.chooses_lobe() ? draw_1d(transport::path_block::kLobe) : 0.0f;
          if (!at.sample(u_lobe, draw_2d(transport::path_block::kDirection), kMode, next)) return false;
          throughput_ *= next.weight;
          previous_pdf_solid_angle_ = next.pdf_solid_angle;
          ray_.direction = next.wi;
          return !throughput_.is_black();
        });
  }

  // eval_pdf(wi, pdf_solid_angle): the value. draw(): sets the ray's direction and its density, or returns
  // false.
  template <class EvalPdf, class Draw>
  [[gnu::always_inline]] bool scatter_from_medium(const scene::SurfaceHit& here, const EvalPdf& eval_pdf,
                                                  const Draw& draw) {
    front_ = {};
    ++scatterings_;
    const auto lit = [&](const scene::DirectSample& light) {
      letters_->lit(sum_, medium_, here.p, {light.wi, light.emitter});
    };
    bool first = false;
    if constexpr (kFirst) {
      first = scatterings_ == 1;
      if (first) sample_first(here, front_, eval_pdf, lit);
    }
    const bool lights = !first && next_event_ && depth_ + 1 >= options_.min_edges;
    if (in_dense_medium()) {
      const scene::Medium& around = scene_.medium(medium_);
      ball_.move(scene_, here.p, around);
      constexpr auto kWhich = transport::path_block::kTransmittance;
      if (lights)
        reach_ = {around, ball_.clearance(), sampler_.draw_2d(block_ + kWhich, false), lamps_are_surfaces_};
    }
    if (lights && !(lamps_are_surfaces_ && reach_.ends_in_medium()))
      sample_light(here, front_, eval_pdf, lit);
    reach_ = {};
    if (!draw()) return false;
    previous_delta_ = false;
    if constexpr (kEdits) edits_->leave_medium();
    if (!first && !survives(true)) return false;
    if constexpr (kLetters) letters_->scattered(medium_, here.p);
    ray_ = {here.p, ray_.direction};
    ++depth_;
    if constexpr (kFirst) {
      if (first) leave_first();
    }
    return true;
  }

  // Flat: GCC otherwise calls the sampler's functions and spawn_ray(), 2 % of the instructions.
  [[gnu::flatten]] bool scatter(const scene::SurfaceHit& hit) {
    const Vec3 wo = hit.shading.to_local(-ray_.direction);
    arena_.clear();
    const scene::Closure closure = closure_at(hit, wo);
    if (closure.black) return false;
    const Vec3 side = closure.scatters_through() ? Vec3{} : wo.z < 0 ? -hit.shading.n : hit.shading.n;
    const bool connectible = !closure.purely_delta();
    scatterings_ += connectible ? 1 : 0;
    const auto eval_pdf = [&](Vec3 wi, float& pdf_solid_angle) {
      return transport::radiance_value(hit, closure, wo, wi, pdf_solid_angle);
    };
    const auto lit = [&](const scene::DirectSample& light) {
      letters_->lit(sum_, hit, closure, -ray_.direction, {light.wi, light.emitter});
    };
    bool first = false;
    if constexpr (kFirst) {
      first = connectible && scatterings_ == 1;
      if (first) sample_first(hit, side, eval_pdf, lit);
    }
    if (!first && next_event_ && connectible && depth_ + 1 >= options_.min_edges)
      sample_light(hit, side, eval_pdf, lit);
    if constexpr (kMollifies) {
      if (closure.has_delta_lobes() && depth_ + 1 >= options_.min_edges)
        mollified_light(hit, transport::SurfaceScattering(hit, closure, -ray_.direction, wo));
    }
    scene::BsdfSample next;
    const float u_lobe = closure.chooses_lobe() ? draw_1d(transport::path_block::kLobe) : 0.0f;
    const Vec2 u = draw_2d(transport::path_block::kDirection);
    if (!transport::sample_radiance(closure, wo, u_lobe, u, next)) return false;
    throughput_ *= next.weight;
    if (throughput_.is_black()) return false;
    if constexpr (kPasses) {
      if (next.passthrough) return pass_through(hit);
    }
    eta_scale_ *= next.eta * next.eta;
    // At the first vertex of FirstT nobody plays: a bsdf ray that ended would be a failure of another
    // density.
    if (!first && !survives(!next.delta && throughput_.max_component() * eta_scale_ > 1)) return false;
    front_ = side;
    previous_delta_ = next.delta;
    previous_pdf_solid_angle_ = next.pdf_solid_angle;
    const Vec3 wi = hit.shading.to_world(next.wi);
    if constexpr (kLetters) letters_->scattered(hit, closure, -ray_.direction, wi, next.delta);
    ray_ = spawn_ray(hit, wi);
    if constexpr (kMedia) enter(hit);
    ++depth_;
    if constexpr (kFirst) {
      if (first) leave_first();
    }
    return true;
  }

  [[gnu::always_inline]] scene::Closure closure_at(const scene::SurfaceHit& hit, Vec3 wo) {
    if constexpr (kEdits)
      return edits_->surface(hit, scene_.closure(hit, wo, arena_));
    else
      return scene_.closure(hit, wo, arena_);
  }

  // All techniques of direct light but the bsdf's, from the vertex `here`.
  template <class EvalPdf, class Lit>
  [[gnu::always_inline]] void sample_first(const scene::SurfaceHit& here, Vec3 side, const EvalPdf& eval_pdf,
                                           [[maybe_unused]] const Lit& lit) {
    using namespace transport;
    first_->reach(scene_.lights(), here.p);
    for (std::size_t i = 0; i < first_->light_draws(); ++i) {
      // The first has the path tracer's random numbers.
      const std::uint32_t at = i == 0 ? block_ : path_block::further_light(i);
      const float u_emitter =
          chooses_emitter_ ? sampler_.draw_1d(at + path_block::kEmitterChoice, stratified_) : 0.0f;
      const Vec2 u = sampler_.draw_2d(at + path_block::kEmitterPoint, stratified_);
      scene::DirectSample light;
      const scene::DirectOutcome outcome =
          first_->sample(scene_.lights(), here, side, u_emitter, u, i, light);
      if (outcome == scene::DirectOutcome::failed) {
        first_->failed(i);
        continue;
      }
      float pdf_solid_angle = 0;
      Spectrum value;
      if (outcome == scene::DirectOutcome::sampled) {
        value = eval_pdf(light.wi, pdf_solid_angle);
        if (!value.is_black()) {
          pass_to_light(here, light, at, value);
          first_->tested(scene_.lights(), light.emitter, !value.is_black());
        }
      }
      if (value.is_black() || light.delta) pdf_solid_angle = 0;
      const Spectrum found =
          first_->drawn(scene_, here, side, i, light, pdf_solid_angle, throughput_ * value * light.radiance);
      sum_ += found;
      if constexpr (kLetters) {
        if (!found.is_black()) lit(light);
      }
    }
  }
  void leave_first() {
    first_depth_ = depth_;
    first_->leave(depth_);
  }

  // Next event estimation from the vertex `here`, which scatters as eval_pdf(wi, pdf) says. lit(light) labels
  // what was added to the sum.
  template <class EvalPdf, class Lit>
  void sample_light(const scene::SurfaceHit& here, Vec3 side, const EvalPdf& eval_pdf, const Lit& lit) {
    using namespace transport;
    if constexpr (kGroups) {
      if (groups_ != nullptr) [[unlikely]]
        return sample_groups(here, side, eval_pdf, lit);
    }
    scene::DirectSample light;
    const float u_emitter = chooses_emitter_ ? draw_1d(path_block::kEmitterChoice) : 0.0f;
    if (scene_.sample_direct(here, side, u_emitter, draw_2d(path_block::kEmitterPoint), light) ==
        scene::DirectOutcome::sampled)
      add_drawn(here, light, block_, eval_pdf, lit);
  }
  // Next event estimation of the delta lobes at `here`, mollified: a path whose last vertex before a light
  // that no ray meets is specular is found in no other way.
  void mollified_light(const scene::SurfaceHit& here, const transport::SurfaceScattering& at) {
    using namespace transport;
    const float u_lobe = at.chooses_lobe() ? draw_1d(path_block::kLobe) : 0.0f;
    const scene::TurningLobes lobes = at.delta_lobes(u_lobe, draw_2d(path_block::kDirection), kMode);
    if (lobes.count == 0) return;
    scene::DirectSample light;
    const float u_emitter = chooses_emitter_ ? draw_1d(path_block::kEmitterChoice) : 0.0f;
    if (scene_.sample_direct(here, {}, u_emitter, draw_2d(path_block::kEmitterPoint), light) !=
            scene::DirectOutcome::sampled ||
        !light.delta)
      return;
    double length = 0;
    Spectrum value = light_in_lobes(scene_, here, lobes, light, mollified_.by, length);
    if (value.is_black()) return;
    pass_to_light(here, light, block_, value);
    sum_ += throughput_ * value;
    mollified_.sum += throughput_ * value;
  }

  template <class EvalPdf, class Lit>
  [[gnu::noinline]] void sample_groups(const scene::SurfaceHit& here, Vec3 side, const EvalPdf& eval_pdf,
                                       const Lit& lit) {
    using namespace transport;
    std::uint32_t block = block_;
    for (std::size_t g = 0; g < groups_->size(); ++g, block += path_block::kNextGroup) {
      const float u_emitter = sampler_.draw_1d(block + path_block::kEmitterChoice, stratified_);
      const Vec2 u = sampler_.draw_2d(block + path_block::kEmitterPoint, stratified_);
      scene::DirectSample light;
      if (scene_.lights().sample(here, side, u_emitter, u, light, kChoice, (*groups_)[g],
                                 scene::PointSampler::own) == scene::DirectOutcome::sampled)
        add_drawn(here, light, block, eval_pdf, lit);
    }
  }
  // Adds the light that a point on an emitter, drawn with numbers of the block, sends to `here`.
  template <class EvalPdf, class Lit>
  [[gnu::always_inline]] void add_drawn(const scene::SurfaceHit& here, const scene::DirectSample& light,
                                        std::uint32_t block, const EvalPdf& eval_pdf,
                                        [[maybe_unused]] const Lit& lit) {
    float pdf_solid_angle = 0;
    if constexpr (kEdits) edits_->towards_lamp(light.emitter);
    Spectrum value = eval_pdf(light.wi, pdf_solid_angle);
    if (value.is_black()) return;
    pass_to_light(here, light, block, value);
    if (value.is_black()) return;
    float weight = 1 / light.pdf_solid_angle;
    if (weighs_ && !light.delta)
      weight *= transport::mis_weight(light.pdf_solid_angle, pdf_solid_angle, power_);
    sum_ += throughput_ * value * light.radiance * weight;
    if constexpr (kLetters) lit(light);
  }

  // Multiplies by what arrives of the light; black if nothing does.
  void pass_to_light(const scene::SurfaceHit& here, const scene::DirectSample& light, std::uint32_t block,
                     Spectrum& value) {
    using namespace transport;
    if constexpr (kPasses) {
      rng::Stream stream(0);
      std::uint32_t through = medium_;
      if constexpr (kMedia) {
        const Vec2 u = sampler_.draw_2d(block + path_block::kTransmittance, false);
        stream = rng::Stream(rng::key(std::bit_cast<std::uint32_t>(u.x), std::bit_cast<std::uint32_t>(u.y)));
        through = scene_.medium_beyond(here, light.wi, through);
      }
      value *= passing<kEdgeContent>(scene_, light.shadow_ray, through, stream, rays_, nullptr, &reach_);
    } else {
      ++rays_;
      if (scene_.occluded(light.shadow_ray)) value = {};
    }
  }

  // Light that the ray found by itself.
  void add_environment() {
    Spectrum arriving = scene_.environment(ray_.direction);
    if constexpr (kEdits) {
      if (!arriving.is_black()) arriving *= edits_->share_at_lamp(scene_.lights().environments()[0]);
    }
    if (arriving.is_black()) return;
    if constexpr (kFirst) {
      if (depth_ == first_depth_) {
        const Spectrum found =
            first_->found(scene_.lights(), previous(), front_, ray_.direction, nullptr,
                          previous_pdf_solid_angle_, previous_delta_, throughput_ * arriving);
        sum_ += found;
        if constexpr (kLetters) {
          if (!found.is_black()) letters_->met_outside(sum_, ray_.direction);
        }
        return;
      }
    }
    float weight = 1;
    if (weighs_ && !previous_delta_)
      weight = transport::mis_weight(previous_pdf_solid_angle_, pdf_environment_solid_angle(), power_);
    sum_ += throughput_ * arriving * weight;
    if constexpr (kLetters) letters_->met_outside(sum_, ray_.direction);
  }
  void add_emitted(const scene::SurfaceHit& hit) {
    Spectrum emitted = scene_.emitted(hit, -ray_.direction);
    if constexpr (kEdits) emitted *= edits_->share_at_lamp(hit.emitter);
    if (emitted.is_black()) return;
    if constexpr (kFirst) {
      if (depth_ == first_depth_) {
        const Spectrum found =
            first_->found(scene_.lights(), previous(), front_, ray_.direction, &hit,
                          previous_pdf_solid_angle_, previous_delta_, throughput_ * emitted);
        sum_ += found;
        if constexpr (kLetters) {
          if (!found.is_black()) letters_->met(sum_, hit.emitter);
        }
        return;
      }
    }
    float weight = 1;
    if (weighs_ && !previous_delta_)
      weight = transport::mis_weight(previous_pdf_solid_angle_, pdf_light_solid_angle(hit), power_);
    sum_ += throughput_ * emitted * weight;
    if constexpr (kLetters) letters_->met(sum_, hit.emitter);
  }
  // The densities with which next event estimation at the vertex before would have drawn the ray's direction:
  // to outside of the scene, to the light that the ray met.
  float pdf_environment_solid_angle() const {
    if constexpr (kGroups) {
      if (groups_ != nullptr) [[unlikely]]
        return scene_.lights().pdf_environment_solid_angle(previous(), front_, ray_.direction, kChoice,
                                                           (*groups_)[groups_->of_environment()]);
    }
    return scene_.pdf_direct_environment_solid_angle(previous(), front_, ray_.direction);
  }
  float pdf_light_solid_angle(const scene::SurfaceHit& hit) const {
    if constexpr (kGroups) {
      if (groups_ != nullptr) [[unlikely]] {
        const scene::Lights& lights = scene_.lights();
        return lights.pdf_point_solid_angle(previous(), front_, ray_.direction, hit,
                                            scene::PointSampler::own) *
               lights.prob(previous().p, front_, hit.emitter, kChoice, (*groups_)[groups_->of(hit.emitter)]);
      }
    }
    return scene_.pdf_direct_solid_angle(previous(), front_, ray_.direction, hit);
  }

  // Survivors are scaled up. bright: no bound on the probability, up to so many edges.
  bool survives(bool bright) {
    if (depth_ < options_.rr_depth) return true;
    const bool free = bright && depth_ < transport::kPathRoulette.free_depth;
    if (bright && !free) [[unlikely]]
      note_bound();
    const float survive = transport::kPathRoulette.survival(throughput_.max_component() * eta_scale_,
                                                            free ? 1.0f : transport::kMaxSurvival);
    if (!(draw_1d(transport::path_block::kRoulette) < survive)) return false;
    throughput_ *= 1 / survive;
    return true;
  }

  void note_bound() {
    if (bounded_ || !transport::kPathRoulette.binds(throughput_.max_component() * eta_scale_)) return;
    bounded_ = true;
    ++sample_counts_.bounded_walks;
  }

  // Leaves the surface along the ray's direction.
  void enter(const scene::SurfaceHit& hit) {
    medium_ = scene_.medium_beyond(hit, ray_.direction, medium_);
    ball_.leave();
  }

  // On through a surface that changes nothing but the throughput. False: the ray does not get on.
  bool pass_through(const scene::SurfaceHit& hit) {
    if constexpr (kMedia) enter(hit);
    ray_ = spawn_ray(hit, ray_.direction);
    return ++passes_ < transport::kMaxPasses;
  }

  const scene::SurfaceHit& previous() const { return hits_[~depth_ & 1]; }

  const SceneT& scene_;
  const PathOptions& options_;
  const bool hit_light_, next_event_, weighs_, power_, chooses_emitter_, lamps_are_surfaces_;
  SamplerT& sampler_;
  film::SampleCounts& sample_counts_;
  [[maybe_unused]] FirstT* const first_;
  [[maybe_unused]] const scene::LightGroups* const groups_;
  [[maybe_unused]] transport::EyeLetters* const letters_;  // of this path, if they are read
  [[maybe_unused]] scene::EditedWalk* const edits_;        // likewise

  Ray ray_;
  Spectrum sum_;
  Spectrum throughput_{1.0f};  // scattering values times cosines over densities, along the path so far
  float eta_scale_ = 1;  // squared relative index since the camera: the roulette undoes radiance's 1/eta^2
  std::uint32_t depth_ = 1, block_ = transport::kEyeDimensions, passes_ = 0;
  std::uint32_t scatterings_ = 0;        // vertices so far that are not specular
  bool stratified_ = true;               // draws of the present vertex
  std::uint32_t medium_ = scene::kNone;  // that the ray is in
  // In dense media: around the last vertex; of its next event estimation.
  [[no_unique_address]] std::conditional_t<kMedia, transport::EmptyBall, transport::NoEmptyBall> ball_;
  [[no_unique_address]] std::conditional_t<kMedia, transport::LightReach, transport::NoLightReach> reach_;
  std::uint64_t rays_ = 0;
  bool bounded_ = false;       // roulette ends it for its edges, and it is counted
  scene::SurfaceHit hits_[2];  // the edge's end and its start, in turn
  scene::ClosureArena arena_;
  // Not read but if it mollifies.
  [[no_unique_address]] std::conditional_t<kMollifies, Mollification, NoMollifier> mollified_;
  // The vertex before: a light cannot sample the camera; its shading normal lies on the viewer's side, and is
  // zero if it scatters through, and in a medium.
  bool previous_delta_ = true;
  float previous_pdf_solid_angle_ = 0;
  Vec3 front_;
  [[maybe_unused]] std::uint32_t first_depth_ = 0;  // edges to what the first vertex's own ray meets
};

}  // namespace candela::estimators
