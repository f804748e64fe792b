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
// Dimensions: [0] film position, [1] lens, then a block of draws for each stretch of a ray. A draw that
// nothing at the vertex reads is not made. Behind the first kStratifiedVertices vertices that are not
// specular the draws are independent ones: stratifying them gains less than it costs.
//
// Russian roulette from rr_depth on: a path survives with 1 / kRouletteFloor times the probability Mitsuba
// gives it (the throughput's largest component, radiance's 1/eta^2 undone). Where light is hard to find, what
// a few long paths bring is most of the variance, and ending them early with their survivors scaled up makes
// it worse; where it is easy, long paths are only time. The factor is measured (docs/integrators/path.md).
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>

#include "common/film/counts.h"
#include "worker/integrators/path/techniques.h"
#include "worker/samplers/sampler.h"
#include "worker/scene/scene.h"
#include "worker/transport/between.h"

namespace candela::integrators::path {

using scene::Closure;
using scene::DirectSample;
using scene::SurfaceHit;
using scene::TransportMode;
using transport::inside_medium;
using transport::medium_vertex;
using transport::passing;

// The radiance arriving along `ray`. SceneT is scene::Scene, or what stands in for it to watch the rays.
// SamplerT likewise: samplers::Sampler, or a chain's.
template <bool kNextEvent, bool kHitEmitters, bool kEnvironment, bool kWeigh, Between kBetween, class SceneT,
          class SamplerT = samplers::Sampler>
Spectrum radiance(const SceneT& scene, const Limits& limits, Ray ray, SamplerT& sampler,
                  film::Tallies& tallies) {
  constexpr bool kPasses = kBetween != Between::nothing, kMedia = kBetween == Between::media;
  Spectrum sum;
  Spectrum throughput(1.0f);
  float eta_scale = 1;  // squared relative index since the camera: undoes radiance's 1/eta^2 for the roulette
  bool previous_delta = true;  // the camera cannot be sampled from a light
  float previous_pdf_solid_angle = 0;
  SurfaceHit hits[2];  // the edge's end and its start, in turn
  scene::ClosureArena arena;
  Vec3 front;  // the previous vertex's shading normal, on the viewer's side; zero where it scatters through,
               // and in a medium
  std::uint32_t scatterings = 0;  // vertices so far that are not specular
  std::uint32_t block = kCameraDimensions;
  std::uint32_t passes = 0;
  std::uint32_t medium = scene::kNone;  // that the ray is in
  std::uint64_t rays = 0;
  if constexpr (kMedia) medium = scene.camera_medium(ray);

  // Next event estimation from the vertex `here`, which scatters as eval_pdf(wi, pdf) says.
  const auto sample_light = [&](const SurfaceHit& here, Vec3 side, std::uint32_t through, bool stratified,
                                const auto& eval_pdf) {
    DirectSample light;
    float u_emitter = 0;
    if (limits.choose_emitter) u_emitter = sampler.draw_1d(block + kEmitterChoice, stratified);
    if (scene.sample_direct(here, side, u_emitter, sampler.draw_2d(block + kEmitterPoint, stratified),
                            light) != scene::DirectOutcome::sampled)
      return;
    float pdf_solid_angle = 0;
    Spectrum value = eval_pdf(light.wi, pdf_solid_angle);
    if (value.is_black()) return;
    if constexpr (kPasses) {
      rng::Stream stream(0);
      if constexpr (kMedia) {
        const Vec2 u = sampler.draw_2d(block + kTransmittance, false);
        stream = rng::Stream(rng::key(std::bit_cast<std::uint32_t>(u.x), std::bit_cast<std::uint32_t>(u.y)));
        through = scene.medium_beyond(here, light.wi, through);
      }
      value *= passing<kBetween>(scene, light.shadow_ray, through, stream, rays);
      if (value.is_black()) return;
    } else {
      ++rays;
      if (scene.occluded(light.shadow_ray)) return;
    }
    float weight = 1 / light.pdf_solid_angle;
    if (kWeigh && !light.delta)
      weight *= mis_weight(light.pdf_solid_angle, pdf_solid_angle, limits.power_heuristic);
    sum += throughput * value * light.radiance * weight;
  };
  // False: the path ends. Survivors are scaled up.
  const auto survives = [&](std::uint32_t depth, bool stratified, float most) {
    if (depth < limits.rr_depth) return true;
    const float survive = std::min(throughput.max_component() * eta_scale * (1 / kRouletteFloor), most);
    if (!(sampler.draw_1d(block + kRoulette, stratified) < survive)) return false;
    throughput *= 1 / survive;
    return true;
  };
  // On through a surface that changes nothing but the throughput. False: the ray does not get on.
  const auto pass_straight = [&](const SurfaceHit& hit) {
    if constexpr (kMedia) medium = scene.medium_beyond(hit, ray.direction, medium);
    ray = spawn_ray(hit, ray.direction);
    return ++passes < kMostPasses;
  };

  // An iteration is a stretch of a ray up to the next surface or scattering. depth counts edges between
  // vertices that scatter: passing straight does not.
  for (std::uint32_t depth = 1; depth <= limits.max_depth; block += kMedia ? kMediaBlock : kBlock) {
    SurfaceHit& hit = hits[depth & 1];
    const SurfaceHit& previous = hits[~depth & 1];
    const bool stratified = scatterings < kStratifiedVertices;
    ++rays;
    const bool found = scene.intersect(ray, hit);

    // A flight through the medium up to here, or to a scattering before.
    if constexpr (kMedia) {
      if (medium != scene::kNone) {
        const scene::Medium& around = scene.medium(medium);
        const Ray stretch = inside_medium(ray, found ? &hit : nullptr);
        const Vec2 u = sampler.draw_2d(block + kFlight, stratified);
        scene::DistanceSample flight;
        if (depth < limits.max_depth) {
          flight = around.sample_distance(stretch, throughput, u);
        } else {  // nothing may scatter any more
          rng::Stream stream(rng::key(std::bit_cast<std::uint32_t>(u.x), std::bit_cast<std::uint32_t>(u.y)));
          flight.weight = around.transmittance(stretch, stream);
        }
        throughput *= flight.weight;
        if (throughput.is_black()) break;
        if (flight.scattered) {
          medium_vertex(ray, flight.distance, hit);
          const Vec3 wo = -ray.direction;
          front = {};
          ++scatterings;
          if constexpr (kNextEvent) {
            if (depth + 1 >= limits.least_edges)
              sample_light(hit, front, medium, stratified, [&](Vec3 wi, float& pdf_solid_angle) {
                pdf_solid_angle = around.phase().pdf_solid_angle(wo, wi);
                return Spectrum(around.phase().eval(wo, wi));
              });
          }
          previous_pdf_solid_angle =
              around.phase().sample(wo, sampler.draw_2d(block + kDirection, stratified), ray.direction);
          previous_delta = false;
          if (!survives(depth, stratified, depth < kLongFlight ? 1.0f : kLongestSurvival)) break;
          ray = {hit.p, ray.direction};
          ++depth;
          continue;
        }
      }
    }

    // Light that this edge found by itself.
    if (!found) {
      if constexpr (kEnvironment) {
        if (depth >= limits.least_edges) {
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
      if (hit.emitter != scene::kNone && depth >= limits.least_edges) {
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
    if (depth == limits.max_depth) {  // light may still arrive straight through
      if constexpr (kPasses) {
        throughput *= scene.straight(hit, wo_world);
        if (!throughput.is_black() && pass_straight(hit)) continue;
      }
      break;
    }

    const Vec3 wo = hit.shading.to_local(wo_world);
    arena.clear();
    const Closure closure = scene.closure(hit, wo, arena);
    if (closure.black) break;
    const Vec3 side = closure.scatters_through() ? Vec3{} : wo.z < 0 ? -hit.shading.n : hit.shading.n;
    scatterings += closure.purely_delta() ? 0 : 1;

    if constexpr (kNextEvent) {
      if (!closure.purely_delta() && depth + 1 >= limits.least_edges)
        sample_light(hit, side, medium, stratified, [&](Vec3 wi, float& pdf_solid_angle) {
          return closure.eval_pdf(wo, hit.shading.to_local(wi), TransportMode::radiance, pdf_solid_angle);
        });
    }

    // On along the bsdf.
    scene::BsdfSample next;
    const float u_lobe = closure.chooses_lobe() ? sampler.draw_1d(block + kLobe, stratified) : 0.0f;
    if (!closure.sample(wo, u_lobe, sampler.draw_2d(block + kDirection, stratified), TransportMode::radiance,
                        next))
      break;
    throughput *= next.weight;
    if (throughput.is_black()) break;
    if constexpr (kPasses) {
      if (next.straight) {
        if (!pass_straight(hit)) break;
        continue;
      }
    }
    eta_scale *= next.eta * next.eta;
    const bool bright = !next.delta && depth < kLongFlight && throughput.max_component() * eta_scale > 1;
    if (!survives(depth, stratified, bright ? 1.0f : kLongestSurvival)) break;

    front = side;
    previous_delta = next.delta;
    previous_pdf_solid_angle = next.pdf_solid_angle;
    ray = spawn_ray(hit, hit.shading.to_world(next.wi));
    if constexpr (kMedia) medium = scene.medium_beyond(hit, ray.direction, medium);
    ++depth;
  }
  tallies.rays += rays;
  return sum;
}

}  // namespace candela::integrators::path
