// The work for one path from the light and one from the eye: every way to join them. A path of s vertices
// from the light and t from the eye has s + t - 1 edges:
//   s = 0         the eye's walk meets light                   t = 0   a light path meets a finite lens
//   s = 1         next event estimation                        t = 1   connection to the lens: a splat
//   s, t >= 2     connection of a light and an eye vertex
// Light seen directly (one edge) is left to s = 0, which finds it without noise.
//
// What is found goes to a sink: a film, or a chain's list.
#pragma once

#include <cstdint>

#include "worker/scene/scene.h"
#include "worker/transport/connect.h"
#include "worker/transport/emission.h"
#include "worker/transport/subpath.h"
#include "worker/transport/technique_list.h"

namespace candela::integrators::bdpt {

// What the plan decided.
struct Techniques {
  bool light_paths = true;  // any light subpath at all
  bool hit_light = true, next_event = true, connect = true, light_image = true, hit_lens = true;
};

struct Limits {
  std::uint32_t max_depth = 0, rr_depth = 2;
  std::uint32_t least_edges = 1;  // of paths that count, at most 3: 2 leaves out emitters seen by the camera
  bool choose_emitter = true;
  transport::MisHeuristic heuristic = transport::MisHeuristic::balance;
};

// How many paths there are to be weighed against each other; places on the film are uniform.
struct PathCounts {
  double eye_paths = 1;  // over the film: of these the density of eye paths is width * height-fold
  double light_paths = 1;
  float film_border = 0;  // pixels around the film that eye paths come from, or that splats matter in
};

// Every technique of every length.
struct EveryTechnique {
  static constexpr bool wants(std::uint32_t, std::uint32_t) { return true; }
  static constexpr bool light_goes_on(std::uint32_t) { return true; }
  static constexpr bool eye_goes_on(std::uint32_t) { return true; }
};

// One: paths of s vertices from the light and t from the eye.
struct OneTechnique {
  std::uint32_t s = 0, t = 0;
  bool wants(std::uint32_t s_, std::uint32_t t_) const { return s == s_ && t == t_; }
  // Beyond a vertex of so many edges. (One that is passed straight is not behind.)
  bool light_goes_on(std::uint32_t edges) const { return edges + 1 < s; }
  bool eye_goes_on(std::uint32_t edges) const { return edges + 1 < t; }
};

// Config: kBetween; Heuristic; kLists: heuristics that need all densities, Heuristic is Balance then;
// Sampler; Choice: one of the above; Sink, with
//   eye(contribution, s, t)              techniques of t >= 2: along the eye's ray
//   light(contribution, s, t, at, key)   t < 2: to be divided by the number of light paths
template <class Config>
class Kernel {
 public:
  static constexpr transport::Between kBetween = Config::kBetween;
  static constexpr bool kLists = Config::kLists;
  using Heuristic = typename Config::Heuristic;
  using Sampler = typename Config::Sampler;
  using Sink = typename Config::Sink;
  using Choice = typename Config::Choice;
  using EyeWalk = transport::Walk<scene::TransportMode::radiance, kBetween, Heuristic, Sampler>;
  using LightWalk = transport::Walk<scene::TransportMode::importance, kBetween, Heuristic, Sampler>;
  using Contribution = transport::Contribution;
  using Steps = transport::Steps;
  using Vertex = transport::Vertex;

  Kernel(const scene::Scene& scene, const Limits& limits, const Techniques& techniques,
         const PathCounts& counts, Sink& sink, film::Tallies& tallies)
      : scene_(scene), limits_(limits), techniques_(techniques), sink_(sink), tallies_(tallies) {
    const double n = Heuristic::raise(counts.light_paths);
    const auto one = [](bool runs) { return runs ? 1.0 : 0.0; };
    factors_ = {one(techniques.hit_light), one(techniques.next_event), one(techniques.connect),
                n * one(techniques.light_image), n * one(techniques.hit_lens)};
    eye_rules_.max_edges = limits.max_depth;
    eye_rules_.rr_depth = light_rules_.rr_depth = limits.rr_depth;
    light_rules_.max_edges = limits.max_depth - 1;
    eye_rules_.meets_lens = light_rules_.meets_lens = techniques.hit_lens;
    eye_rules_.film_border = light_rules_.film_border = counts.film_border;
    eye_rules_.eye_paths = light_rules_.eye_paths = counts.eye_paths;
  }

  // The light path of the sampler, kept.
  void trace_light(Sampler& sampler);
  // No light path: there are no light vertices to connect to.
  void no_light() { light_.clear(); }
  std::uint32_t light_size() const { return light_.size(); }
  // The eye path along a ray.
  void trace_eye(const Ray& ray, Sampler& sampler);

  // Of the paths to come, all of which have s + t - 1 edges.
  void choose(const Choice& choice) {
    choice_ = choice;
    eye_rules_.max_edges = choice.s + choice.t - 1;
    light_rules_.max_edges = eye_rules_.max_edges - 1;
  }

 private:
  void weigh(Contribution& light) {
    if constexpr (kLists) light.weight = list_.weight(limits_.heuristic);
  }

  const scene::Scene& scene_;
  const Limits& limits_;
  const Techniques& techniques_;
  Sink& sink_;
  film::Tallies& tallies_;
  Choice choice_;
  transport::MisFactors factors_;
  transport::WalkRules eye_rules_, light_rules_;
  transport::MergeFactors no_merging_;
  transport::Subpath light_, eye_;
  transport::TechniqueList list_;
};

template <class Config>
void Kernel<Config>::trace_light(Sampler& sampler) {
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
    if (walk.lens().met && walk.lens().edges >= limits_.least_edges &&
        choice_.wants(walk.lens().edges + 1, 0)) {
      light = transport::hit_lens<Heuristic>(context, walk, no_merging_, at, kLists ? &steps : nullptr);
      if (light.weight > 0) {
        if constexpr (kLists) {
          const Vertex& last = light_[parent];
          list_.clear();
          list_.add(steps.next);
          list_.add_side(light_, last, steps.light_step, last.pdf_reverse, last.left_by_delta);
        }
        weigh(light);
        sink_.light(light, walk.lens().edges + 1, 0, at, rng::combine(key, 2));
      }
    }
    if (event != LightWalk::Event::vertex) return;
    v.parent = parent;
    if (techniques_.light_image && v.connects && v.edges + 1 >= limits_.least_edges &&
        choice_.wants(v.edges + 1, 1) &&
        transport::connect_lens<kBetween, Heuristic>(context, sampler, walk.block(), walk.stratified(), v,
                                                     no_merging_, at, light, kLists ? &steps : nullptr)) {
      if constexpr (kLists) {
        list_.clear();
        list_.add(steps.next);
        list_.add_side(light_, v, steps.light_step, steps.light_reverse);
      }
      weigh(light);
      sink_.light(light, v.edges + 1, 1, at, rng::combine(key, 3));
    }
    const bool last = !choice_.light_goes_on(v.edges);
    auto step = LightWalk::Step::ended;
    if (!last || LightWalk::kPasses) step = walk.scatter(v);
    if (last && step == LightWalk::Step::scattered) step = LightWalk::Step::ended;
    if (step == LightWalk::Step::ended && !v.connects) return;
    const std::uint32_t kept = light_.keep();
    if (step == LightWalk::Step::ended) return;
    if (step == LightWalk::Step::scattered) parent = kept;
  }
}

template <class Config>
void Kernel<Config>::trace_eye(const Ray& ray, Sampler& sampler) {
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
    if (techniques_.hit_light && v.edges >= limits_.least_edges && choice_.wants(0, v.edges + 1) &&
        transport::hit_light<Heuristic>(context, v, left, parent == scene::kNone ? nullptr : &eye_[parent],
                                        no_merging_, light, wanted)) {
      if (kLists && v.edges > 1) {
        list_.clear();
        list_.add(steps.next);
        list_.add_side(eye_, v, steps.eye_step, steps.eye_reverse, true);
        weigh(light);
      }
      sink_.eye(light, 0, v.edges + 1);
    }
    if (left) break;
    if (v.connects && v.edges < eye_rules_.max_edges) {
      if (techniques_.next_event && v.edges + 1 >= limits_.least_edges && choice_.wants(1, v.edges + 1) &&
          transport::next_event<kBetween, Heuristic>(context, sampler, walk.block(), walk.stratified(),
                                                     limits_.choose_emitter, v, no_merging_, light, wanted)) {
        if constexpr (kLists) {
          list_.clear();
          list_.add(steps.next);
          list_.add_side(eye_, v, steps.eye_step, steps.eye_reverse);
          weigh(light);
        }
        sink_.eye(light, 1, v.edges + 1);
      }
      if (techniques_.connect) {
        const std::uint64_t passage = transport::passage_key<kBetween>(sampler, walk.block(), 0);
        for (std::uint32_t i = 0; i < light_.size(); ++i) {
          const Vertex& z = light_[i];
          if (!z.connects || z.edges + v.edges + 1 > eye_rules_.max_edges) continue;
          if (!choice_.wants(z.edges + 1, v.edges + 1)) continue;
          if (!transport::connect<kBetween, Heuristic>(context, z, v, rng::combine(passage, i + 1),
                                                       no_merging_, light, wanted))
            continue;
          if constexpr (kLists) {
            list_.clear();
            list_.add_side(light_, z, steps.light_step, steps.light_reverse);
            list_.add_side(eye_, v, steps.eye_step, steps.eye_reverse);
            weigh(light);
          }
          sink_.eye(light, z.edges + 1, v.edges + 1);
        }
      }
    }
    const bool last = !choice_.eye_goes_on(v.edges);
    auto step = EyeWalk::Step::ended;
    if (!last || EyeWalk::kPasses) step = walk.scatter(v);
    if (step == EyeWalk::Step::ended || (last && step == EyeWalk::Step::scattered)) break;
    const std::uint32_t kept = eye_.keep();
    if (step == EyeWalk::Step::scattered) parent = kept;
  }
}

}  // namespace candela::integrators::bdpt
