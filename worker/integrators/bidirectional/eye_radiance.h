// The radiance along an eye ray by the eye's walk alone: light met and next event estimation.
#pragma once

#include "common/film/counts.h"
#include "worker/samplers/sampler.h"
#include "worker/scene/scene.h"
#include "worker/transport/connect.h"
#include "worker/transport/emission.h"
#include "worker/transport/walk.h"

namespace candela::integrators::bidirectional {

template <transport::Between kBetween>
Spectrum eye_radiance(const scene::Scene& scene, const transport::WalkRules& rules, bool choose_emitter,
                      bool hide_emitters, const Ray& ray, samplers::Sampler& sampler,
                      film::Tallies& tallies) {
  using namespace transport;
  using EyeWalk = Walk<TransportMode::radiance, kBetween, Balance>;
  const MisFactors factors{1, 1, 0, 0, 0};
  const ConnectContext context{scene, factors, rules, tallies};
  const MergeFactors no_merging;
  Spectrum sum;
  Vertex vertices[2];
  scene::ClosureArena arenas[2];
  const Vertex* before = nullptr;
  int slot = 0;
  EyeWalk walk(scene, rules, factors, sampler, tallies);
  walk.start_eye(ray);
  for (;;) {
    Vertex& v = vertices[slot];
    const auto event = walk.advance(v, arenas[slot]);
    if (event == EyeWalk::Event::ended) break;
    const bool left = event == EyeWalk::Event::left;
    Contribution light;
    if ((v.edges > 1 || !hide_emitters) && hit_light<Balance>(context, v, left, before, no_merging, light))
      sum += light.weighted();
    if (left) break;
    if (v.connects && v.edges < rules.max_edges &&
        next_event<kBetween, Balance>(context, sampler, walk.block(), walk.stratified(), choose_emitter, v,
                                      no_merging, light))
      sum += light.weighted();
    const auto step = walk.scatter(v);
    if (step == EyeWalk::Step::ended) break;
    if (step == EyeWalk::Step::scattered) {
      before = &v;
      slot ^= 1;
    }
  }
  return sum;
}

}  // namespace candela::integrators::bidirectional
