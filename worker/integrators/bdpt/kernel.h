// One iteration's work for one pixel: a light path, an eye path, and every way to join them. A path of s
// vertices from the light and t from the eye has s + t - 1 edges:
//   s = 0         the eye's walk meets light                   t = 0   a light path meets a finite lens
//   s = 1         next event estimation                        t = 1   connection to the lens: a splat
//   s, t >= 2     connection of a light and an eye vertex
// Light seen directly (one edge) is left to s = 0, which finds it without noise.
#pragma once

#include <array>
#include <cstdint>

#include "worker/integrators/bdpt/layers.h"
#include "worker/integrators/integrator.h"
#include "worker/transport/connect.h"
#include "worker/transport/emission.h"
#include "worker/transport/splat.h"
#include "worker/transport/subpath.h"
#include "worker/transport/technique_list.h"

namespace candela::integrators::bdpt {

// What the plan decided.
struct Techniques {
  bool light_paths = true;  // any light subpath at all
  bool hit_light = true, next_event = true, connect = true, light_image = true, hit_lens = true;
};

struct Limits {
  std::uint32_t max_depth = 0, rr_depth = 5;
  bool hide_emitters = false;
  bool choose_emitter = true;
  transport::MisHeuristic heuristic = transport::MisHeuristic::balance;
};

// kLists: heuristics that need all densities; Heuristic is Balance then.
template <transport::Between kBetween, class Heuristic, bool kLists>
class Kernel {
 public:
  using EyeWalk = transport::Walk<scene::TransportMode::radiance, kBetween, Heuristic>;
  using LightWalk = transport::Walk<scene::TransportMode::importance, kBetween, Heuristic>;
  using Contribution = transport::Contribution;
  using Steps = transport::Steps;
  using Vertex = transport::Vertex;

  Kernel(const UnitContext& context, const Limits& limits, const Techniques& techniques,
         const TechniqueLayers& layers, film::UnitFilm& film, film::Tallies& tallies)
      : scene_(context.scene),
        limits_(limits),
        techniques_(techniques),
        layers_(layers),
        film_(film),
        tallies_(tallies),
        splatter_(context.filter, film, context.width, context.height),
        light_paths_(static_cast<double>(context.width) * context.height) {
    const double n = Heuristic::raise(light_paths_);
    const auto one = [](bool runs) { return runs ? 1.0 : 0.0; };
    factors_ = {one(techniques.hit_light), one(techniques.next_event), one(techniques.connect),
                n * one(techniques.light_image), n * one(techniques.hit_lens)};
    eye_rules_.max_edges = limits.max_depth;
    eye_rules_.rr_depth = light_rules_.rr_depth = limits.rr_depth;
    light_rules_.max_edges = limits.max_depth - 1;
    eye_rules_.meets_lens = light_rules_.meets_lens = techniques.hit_lens;
    eye_rules_.film_border = light_rules_.film_border = static_cast<float>(context.filter.radius());
    eye_rules_.eye_paths = light_rules_.eye_paths = light_paths_;
  }

  // The light path of the sampler, kept; splats go to the film.
  void trace_light(samplers::Sampler& sampler);
  // The radiance along an eye ray through pixel (x, y), for techniques of t >= 2. scale: of the layers'
  // values.
  Spectrum trace_eye(const Ray& ray, samplers::Sampler& sampler, std::uint32_t x, std::uint32_t y,
                     float scale);

 private:
  // To the layers of s and t; where lists are used it sets the weight first.
  void splat(Contribution& light, std::uint32_t s, std::uint32_t t, transport::FilmPosition at,
             std::uint64_t key);
  void gather(const Contribution& light, std::uint32_t s, std::uint32_t t);
  void weigh(Contribution& light) {
    if constexpr (kLists) light.weight = list_.weight(limits_.heuristic);
  }

  const scene::Scene& scene_;
  const Limits& limits_;
  const Techniques& techniques_;
  const TechniqueLayers& layers_;
  film::UnitFilm& film_;
  film::Tallies& tallies_;
  transport::Splatter splatter_;
  double light_paths_;
  transport::MisFactors factors_;
  transport::WalkRules eye_rules_, light_rules_;
  transport::MergeFactors no_merging_;
  transport::Subpath light_, eye_;
  transport::TechniqueList list_;

  // Of the eye path under way.
  Spectrum sum_;
  std::uint32_t x_ = 0, y_ = 0;
  float scale_ = 1;
  std::uint64_t key_ = 0;
};

template <transport::Between kBetween, class Heuristic, bool kLists>
void Kernel<kBetween, Heuristic, kLists>::splat(Contribution& light, std::uint32_t s, std::uint32_t t,
                                                transport::FilmPosition at, std::uint64_t key) {
  weigh(light);
  const auto each = static_cast<float>(1 / light_paths_);
  const Spectrum weighted = light.weighted() * each;
  splatter_.splat(0, at, weighted, key, tallies_);
  if (!layers_.any()) return;
  if (const std::uint32_t layer = layers_.weighted(s, t); layer != TechniqueLayers::kNoLayer)
    splatter_.splat(layer, at, weighted, key, tallies_);
  if (const std::uint32_t layer = layers_.unweighted(s, t); layer != TechniqueLayers::kNoLayer)
    splatter_.splat(layer, at, light.value * each, key, tallies_);
}

template <transport::Between kBetween, class Heuristic, bool kLists>
void Kernel<kBetween, Heuristic, kLists>::gather(const Contribution& light, std::uint32_t s,
                                                 std::uint32_t t) {
  const Spectrum weighted = light.weighted();
  sum_ += weighted;
  if (!layers_.any()) return;
  // A pixel's own sample, but other threads splat on the same pixels.
  const auto add = [&](std::uint32_t layer, Spectrum value) {
    if (layer == TechniqueLayers::kNoLayer) return;
    value *= scale_;
    film_.splat(layer, x_, y_, {value.r, value.g, value.b}, rng::combine(key_, (std::uint64_t{s} << 32) | t),
                tallies_, true);
  };
  add(layers_.weighted(s, t), weighted);
  add(layers_.unweighted(s, t), light.value);
}

template <transport::Between kBetween, class Heuristic, bool kLists>
void Kernel<kBetween, Heuristic, kLists>::trace_light(samplers::Sampler& sampler) {
  light_.clear();
  const transport::ConnectContext context{scene_, factors_, light_rules_, tallies_};
  LightWalk walk(scene_, light_rules_, factors_, sampler, tallies_);
  ++tallies_.light_paths;
  if (!walk.start_light()) return;
  std::uint32_t parent = scene::kNone;
  Contribution light;
  Steps steps;
  transport::FilmPosition at;
  for (std::uint64_t key = sampler.sample_key();; key = rng::combine(key, 1)) {
    auto& slot = light_.next();
    Vertex& v = slot.vertex;
    const auto event = walk.advance(v, slot.arena);
    if (walk.lens().met) {
      light = transport::hit_lens<Heuristic>(context, walk, no_merging_, at, kLists ? &steps : nullptr);
      if (light.weight > 0) {
        if constexpr (kLists) {
          const Vertex& last = light_[parent];
          list_.clear();
          list_.add(steps.next);
          list_.add_side(light_, last, steps.light_step, last.pdf_reverse, last.left_by_delta);
        }
        splat(light, walk.lens().edges + 1, 0, at, rng::combine(key, 2));
      }
    }
    if (event != LightWalk::Event::vertex) return;
    v.parent = parent;
    if (techniques_.light_image && v.connects &&
        transport::connect_lens<kBetween, Heuristic>(context, sampler, walk.block(), walk.stratified(), v,
                                                     no_merging_, at, light, kLists ? &steps : nullptr)) {
      if constexpr (kLists) {
        list_.clear();
        list_.add(steps.next);
        list_.add_side(light_, v, steps.light_step, steps.light_reverse);
      }
      splat(light, v.edges + 1, 1, at, rng::combine(key, 3));
    }
    const auto step = walk.scatter(v);
    if (step == LightWalk::Step::ended && !v.connects) return;
    const std::uint32_t kept = light_.keep();
    if (step == LightWalk::Step::ended) return;
    if (step == LightWalk::Step::scattered) parent = kept;
  }
}

template <transport::Between kBetween, class Heuristic, bool kLists>
Spectrum Kernel<kBetween, Heuristic, kLists>::trace_eye(const Ray& ray, samplers::Sampler& sampler,
                                                        std::uint32_t x, std::uint32_t y, float scale) {
  sum_ = {};
  x_ = x;
  y_ = y;
  scale_ = scale;
  key_ = sampler.sample_key();
  eye_.clear();
  const transport::ConnectContext context{scene_, factors_, eye_rules_, tallies_};
  EyeWalk walk(scene_, eye_rules_, factors_, sampler, tallies_);
  walk.start_eye(ray);
  std::uint32_t parent = scene::kNone;
  Contribution light;
  Steps steps;
  Steps* const wanted = kLists ? &steps : nullptr;
  for (;;) {
    auto& slot = eye_.next();
    Vertex& v = slot.vertex;
    const auto event = walk.advance(v, slot.arena);
    if (event == EyeWalk::Event::ended) break;
    const bool left = event == EyeWalk::Event::left;
    v.parent = parent;
    if (techniques_.hit_light && (v.edges > 1 || !limits_.hide_emitters) &&
        transport::hit_light<Heuristic>(context, v, left, parent == scene::kNone ? nullptr : &eye_[parent],
                                        no_merging_, light, wanted)) {
      if (kLists && v.edges > 1) {
        list_.clear();
        list_.add(steps.next);
        list_.add_side(eye_, v, steps.eye_step, steps.eye_reverse, true);
        weigh(light);
      }
      gather(light, 0, v.edges + 1);
    }
    if (left) break;
    if (v.connects && v.edges < limits_.max_depth) {
      if (techniques_.next_event &&
          transport::next_event<kBetween, Heuristic>(context, sampler, walk.block(), walk.stratified(),
                                                     limits_.choose_emitter, v, no_merging_, light, wanted)) {
        if constexpr (kLists) {
          list_.clear();
          list_.add(steps.next);
          list_.add_side(eye_, v, steps.eye_step, steps.eye_reverse);
          weigh(light);
        }
        gather(light, 1, v.edges + 1);
      }
      if (techniques_.connect) {
        const std::uint64_t passage = transport::passage_key<kBetween>(sampler, walk.block(), 0);
        for (std::uint32_t i = 0; i < light_.size(); ++i) {
          const Vertex& z = light_[i];
          if (!z.connects || z.edges + v.edges + 1 > limits_.max_depth) continue;
          if (!transport::connect<kBetween, Heuristic>(context, z, v, rng::combine(passage, i + 1),
                                                       no_merging_, light, wanted))
            continue;
          if constexpr (kLists) {
            list_.clear();
            list_.add_side(light_, z, steps.light_step, steps.light_reverse);
            list_.add_side(eye_, v, steps.eye_step, steps.eye_reverse);
            weigh(light);
          }
          gather(light, z.edges + 1, v.edges + 1);
        }
      }
    }
    const auto step = walk.scatter(v);
    if (step == EyeWalk::Step::ended) break;
    const std::uint32_t kept = eye_.keep();
    if (step == EyeWalk::Step::scattered) parent = kept;
  }
  return sum_;
}

}  // namespace candela::integrators::bdpt
