// Path tracing. A path of depth d has d edges from the camera to the emitter. At each vertex light is
// gathered in two ways: a direction sampled towards an emitter, and the bsdf's own direction should it meet
// one. Both estimate the same integral; each contribution is weighted by the heuristic from the two
// solid-angle densities.
//
// throughput: product of bsdf values times cosines over densities, along the path so far.
// Dimensions: [0] film position, [1] lens, then a block of kBlock draws for each vertex. A draw that nothing
// at the vertex reads is not made. Behind the first kStratifiedVertices vertices that are not specular the
// draws are independent ones: stratifying them gains less than it costs.
//
// Russian roulette from rr_depth on: a path survives with 1 / kRouletteFloor times the probability Mitsuba
// gives it (the throughput's largest component, radiance's 1/eta^2 undone). Where light is hard to find, what
// a few long paths bring is most of the variance, and ending them early with their survivors scaled up makes
// it worse; where it is easy, long paths are only time. The factor is measured (docs/integrators/path.md).
#pragma once

#include <algorithm>
#include <cstdint>

#include "common/film/film.h"
#include "worker/samplers/sampler.h"
#include "worker/scene/scene.h"

namespace candela::integrators::path {

using scene::Closure;
using scene::DirectSample;
using scene::SurfaceHit;
using scene::TransportMode;

inline constexpr std::uint32_t kCameraDimensions = 2;
// A vertex's block.
inline constexpr std::uint32_t kEmitterChoice = 0, kEmitterPoint = 1, kLobe = 2, kDirection = 3,
                               kRoulette = 4, kBlock = 5;
inline constexpr std::uint32_t kStratifiedVertices = 2;
inline constexpr float kRouletteFloor = 0.25f;  // throughput below which a path may end
inline constexpr float kLongestSurvival =
    0.95f;  // keeps a path from living for ever where nothing is absorbed

// What the plan decided, as compile-time facts of the kernel.
struct Techniques {
  bool next_event = true;    // sample emitters
  bool hit_emitters = true;  // surfaces may emit
  bool environment = true;   // light may arrive from outside the scene
  bool weigh = true;         // both techniques can find the same light
};

struct Limits {
  std::uint32_t max_depth;
  std::uint32_t rr_depth;
  bool hide_emitters;
  bool power_heuristic;
  bool choose_emitter;  // Scene::sample_direct reads its u_select
};

// The MIS weight of a technique with density p against one of density q, as a ratio so that it neither over-
// nor underflows. [Veach 1997, Eq. 9.8 (balance) and 9.13 (power, beta = 2)]
inline float mis_weight(float p, float q, bool power) {
  const float ratio = q / p;
  return 1.0f / (1.0f + (power ? ratio * ratio : ratio));
}

// The radiance arriving along `ray`. SceneT is scene::Scene, or what stands in for it to watch the rays.
template <bool kNextEvent, bool kHitEmitters, bool kEnvironment, bool kWeigh, class SceneT>
Spectrum radiance(const SceneT& scene, const Limits& limits, Ray ray, samplers::Sampler& sampler,
                  film::Tallies& tallies) {
  Spectrum sum;
  Spectrum throughput(1.0f);
  float eta_scale = 1;  // squared relative index since the camera: undoes radiance's 1/eta^2 for the roulette
  bool previous_delta = true;  // the camera cannot be sampled from a light
  float previous_pdf_solid_angle = 0;
  SurfaceHit hits[2];  // the edge's end and its start, in turn
  scene::ClosureArena arena;
  Vec3 front;                     // the previous vertex's shading normal, on the viewer's side
  std::uint32_t scatterings = 0;  // vertices so far that are not specular
  std::uint64_t rays = 0;

  for (std::uint32_t depth = 1; depth <= limits.max_depth; ++depth) {
    SurfaceHit& hit = hits[depth & 1];
    const SurfaceHit& previous = hits[~depth & 1];
    ++rays;
    const bool found = scene.intersect(ray, hit);

    // Light that this edge found by itself.
    if (!found) {
      if constexpr (kEnvironment) {
        if (depth > 1 || !limits.hide_emitters) {
          const Spectrum arriving = scene.environment(ray.direction);
          if (!arriving.is_black()) {
            float weight = 1;
            if (kWeigh && !previous_delta)
              weight = mis_weight(previous_pdf_solid_angle,
                                  scene.pdf_direct_environment_solid_angle(previous, front, ray.direction),
                                  limits.power_heuristic);
            sum += throughput * arriving * weight;
          }
        }
      }
      break;
    }
    const Vec3 wo_world = -ray.direction;
    if constexpr (kHitEmitters) {
      if (hit.emitter != scene::kNone && (depth > 1 || !limits.hide_emitters)) {
        const Spectrum emitted = scene.emitted(hit, wo_world);
        if (!emitted.is_black()) {
          float weight = 1;
          if (kWeigh && !previous_delta)
            weight = mis_weight(previous_pdf_solid_angle,
                                scene.pdf_direct_solid_angle(previous, front, ray.direction, hit),
                                limits.power_heuristic);
          sum += throughput * emitted * weight;
        }
      }
    }
    if (depth == limits.max_depth) break;

    const Vec3 wo = hit.shading.to_local(wo_world);
    arena.clear();
    const Closure closure = scene.closure(hit, wo, arena);
    if (closure.black) break;
    front = wo.z < 0 ? -hit.shading.n : hit.shading.n;
    const std::uint32_t block = kCameraDimensions + (depth - 1) * kBlock;
    const bool stratified = scatterings < kStratifiedVertices;
    scatterings += closure.purely_delta() ? 0 : 1;

    // Next event estimation.
    if constexpr (kNextEvent) {
      DirectSample light;
      float u_emitter = 0;
      if (limits.choose_emitter) u_emitter = sampler.draw_1d(block + kEmitterChoice, stratified);
      if (!closure.purely_delta() &&
          scene.sample_direct(hit, front, u_emitter, sampler.draw_2d(block + kEmitterPoint, stratified),
                              light)) {
        float pdf_solid_angle = 0;
        const Spectrum value =
            closure.eval_pdf(wo, hit.shading.to_local(light.wi), TransportMode::radiance, pdf_solid_angle);
        if (!value.is_black()) {
          ++rays;
          if (!scene.occluded(light.shadow_ray)) {
            float weight = 1 / light.pdf_solid_angle;
            if (kWeigh && !light.delta)
              weight *= mis_weight(light.pdf_solid_angle, pdf_solid_angle, limits.power_heuristic);
            sum += throughput * value * light.radiance * weight;
          }
        }
      }
    }

    // On along the bsdf.
    scene::BsdfSample next;
    const float u_lobe = closure.chooses_lobe() ? sampler.draw_1d(block + kLobe, stratified) : 0.0f;
    if (!closure.sample(wo, u_lobe, sampler.draw_2d(block + kDirection, stratified), TransportMode::radiance,
                        next))
      break;
    throughput *= next.weight;
    if (throughput.is_black()) break;
    eta_scale *= next.eta * next.eta;

    if (depth >= limits.rr_depth) {
      const float survive =
          std::min(throughput.max_component() * eta_scale * (1 / kRouletteFloor), kLongestSurvival);
      if (!(sampler.draw_1d(block + kRoulette, stratified) < survive)) break;
      throughput *= 1 / survive;
    }

    previous_delta = next.delta;
    previous_pdf_solid_angle = next.pdf_solid_angle;
    ray = spawn_ray(hit, hit.shading.to_world(next.wi));
  }
  tallies.rays += rays;
  return sum;
}

}  // namespace candela::integrators::path
