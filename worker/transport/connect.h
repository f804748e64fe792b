// What joins a light and an eye subpath to a path: the techniques of mis.h but merging. Each gives the value
// of the estimator without its weight, and the weight.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>

#include "worker/samplers/sampler.h"
#include "worker/transport/between.h"
#include "worker/transport/vertex.h"
#include "worker/transport/walk.h"

namespace candela::transport {

struct Contribution {
  Spectrum value;  // unweighted: value * weight is what goes to the film
  double weight = 0;
  bool is_black() const { return value.is_black(); }
  Spectrum weighted() const { return value * static_cast<float>(weight); }
};

// The densities behind a weight, for heuristics that look at each technique (technique_list.h). Relative to
// the technique at hand: that next to it which is no connection of vertices, and of each side the last
// vertex's density as made by the other, with that vertex's pdf_reverse.
struct Steps {
  double next = 0;
  double light_step = 0, light_reverse = 0;
  double eye_step = 0, eye_reverse = 0;
};

// Common to a kernel's connections.
struct ConnectContext {
  const scene::Scene& scene;
  const MisFactors& factors;
  const WalkRules& rules;
  film::Tallies& tallies;
};

// The fraction of light that passes between vertex v and along `shadow_ray` from it, and the survival of
// weights.
template <Between kBetween>
Spectrum visibility(const ConnectContext& c, const Vertex& v, const Ray& shadow_ray, std::uint64_t stream_key,
                    double& survival) {
  survival = 1;
  if constexpr (kBetween == Between::nothing) {
    ++c.tallies.rays;
    return c.scene.occluded(shadow_ray) ? Spectrum() : Spectrum(1.0f);
  } else {
    std::uint32_t medium = v.medium;
    if constexpr (kBetween == Between::media) {
      if (v.kind == Vertex::Kind::surface)
        medium = c.scene.medium_beyond(v.hit, shadow_ray.direction, v.medium);
    }
    return passing<kBetween>(c.scene, shadow_ray, medium, rng::Stream(stream_key), c.tallies.rays, &survival);
  }
}

// The key of a sub-stream for tracking through media, from the vertex's block; `other` tells the connections
// of one vertex apart.
template <Between kBetween, class SamplerT>
std::uint64_t passage_key(SamplerT& sampler, std::uint32_t block, std::uint32_t other) {
  if constexpr (kBetween != Between::media) return 0;
  const Vec2 u = sampler.draw_2d(block + kTransmittance, false);
  return rng::key(std::bit_cast<std::uint32_t>(u.x), std::bit_cast<std::uint32_t>(u.y), other);
}

// s = 0, the weight. v: where the eye's walk met light. direct_pdf_solid_angle: with which next event
// estimation at the vertex before would have found it, 0 where that is not run; emission: of that light
// leaving this way.
template <class Heuristic>
double weight_hit_light(const ConnectContext& c, const Vertex& v, double direct_pdf_solid_angle,
                        const scene::EmissionDensity& emission, const MergeFactors& eta,
                        Steps* steps = nullptr) {
  if (v.edges == 1) return 1;  // seen directly: no other technique is run for these
  double rest = 0;
  if (v.previous_connects)
    rest = c.factors.next_event * Heuristic::raise(direct_pdf_solid_angle / v.pdf_arrival);
  const double traced = static_cast<double>(emission.prob) * static_cast<double>(emission.pdf_area) *
                        static_cast<double>(emission.pdf_solid_angle);
  if (steps != nullptr) *steps = {.next = rest, .eye_step = 1, .eye_reverse = traced};
  MisBlock block = v.mis;
  block.known = 0;  // that of a connection, whose place next event estimation takes
  rest += sum_of<Heuristic>(block, traced, eta);
  return 1 / (1 + rest);
}

// s = 1: next event estimation at the eye's vertex v, whose path so far is known as v.throughput. front: v's.
template <Between kBetween, class Heuristic, class SamplerT>
bool next_event(const ConnectContext& c, SamplerT& sampler, std::uint32_t block, bool stratified,
                bool choose_emitter, const Vertex& v, const MergeFactors& eta, Contribution& out,
                Steps* steps = nullptr) {
  scene::DirectSample light;
  const float u_emitter = choose_emitter ? sampler.draw_1d(block + kEmitterChoice, stratified) : 0.0f;
  if (c.scene.sample_direct(v.hit, v.front, u_emitter, sampler.draw_2d(block + kEmitterPoint, stratified),
                            light) != scene::DirectOutcome::sampled)
    return false;
  float pdf = 0;
  const Spectrum value = scatter_value(c.scene, v, v.wo, light.wi, TransportMode::radiance, pdf);
  if (value.is_black()) return false;
  double survival = 1;
  const Spectrum passed =
      visibility<kBetween>(c, v, light.shadow_ray, passage_key<kBetween>(sampler, block, 0), survival);
  if (passed.is_black()) return false;
  out.value = v.throughput * value * passed * light.radiance * (1 / light.pdf_solid_angle);
  out.weight = 1;
  if constexpr (Heuristic::kWeighs) {
    const double direct = static_cast<double>(light.pdf_solid_angle);
    // From 1 on relative to next event estimation: hit_light, and what has more vertices from the light.
    double hit = 0, traced = 0, reverse = 0;
    if (!light.delta) hit = static_cast<double>(pdf) * survival / direct;
    scene::EmissionDensity emission;
    if (c.scene.pdf_emission(light, emission)) {
      // P_0 P_1 over C_0.
      traced = static_cast<double>(emission.prob) * static_cast<double>(emission.pdf_area) *
               static_cast<double>(emission.pdf_solid_angle) * survival *
               static_cast<double>(v.density_factor(light.wi)) / direct;
      if (emission.delta_position)
        traced /= length_squared(Vec3d(v.hit.p) - Vec3d(light.p));
      else if (!emission.infinite)
        traced /= static_cast<double>(emission.cosine);
      reverse =
          static_cast<double>(pdf_scatter_solid_angle(c.scene, v, light.wi, v.wo, TransportMode::importance));
    }
    const double merged = v.kind == Vertex::Kind::surface ? eta.surface : eta.medium;
    out.weight = 1 / (1 + c.factors.hit_light * Heuristic::raise(hit) +
                      Heuristic::raise(traced) * (merged + sum_of<Heuristic>(v.mis, reverse, eta)));
    if (steps != nullptr)
      *steps = {.next = c.factors.hit_light * hit, .eye_step = traced, .eye_reverse = reverse};
  }
  return true;
}

// 1 < s, 1 < t: the light's vertex z connected to the eye's vertex y.
template <Between kBetween, class Heuristic>
bool connect(const ConnectContext& c, const Vertex& z, const Vertex& y, std::uint64_t stream_key,
             const MergeFactors& eta, Contribution& out, Steps* steps = nullptr) {
  const Vec3d between = Vec3d(z.hit.p) - Vec3d(y.hit.p);
  const double distance_squared = length_squared(between);
  if (!(distance_squared > 0)) return false;
  const Vec3 to_light = Vec3(between / std::sqrt(distance_squared));
  float pdf_eye = 0, pdf_light = 0;
  const Spectrum at_eye = scatter_value(c.scene, y, y.wo, to_light, TransportMode::radiance, pdf_eye);
  if (at_eye.is_black()) return false;
  const Spectrum at_light = scatter_value(c.scene, z, z.wo, -to_light, TransportMode::importance, pdf_light);
  if (at_light.is_black()) return false;
  const Ray ray =
      spawn_shadow_ray(y.hit, z.hit.p, z.kind == Vertex::Kind::surface ? z.hit.ng : Vec3{}, z.hit.error);
  double survival = 1;
  const Spectrum passed = visibility<kBetween>(c, y, ray, stream_key, survival);
  if (passed.is_black()) return false;
  out.value =
      y.throughput * at_eye * passed * at_light * z.throughput * static_cast<float>(1 / distance_squared);
  out.weight = 1;
  if constexpr (Heuristic::kWeighs) {
    const double spread = survival / distance_squared;
    const double light_step =
        static_cast<double>(pdf_eye) * spread * static_cast<double>(z.density_factor(to_light));
    const double eye_step =
        static_cast<double>(pdf_light) * spread * static_cast<double>(y.density_factor(to_light));
    const auto light_reverse =
        static_cast<double>(pdf_scatter_solid_angle(c.scene, z, -to_light, z.wo, TransportMode::radiance));
    const auto eye_reverse =
        static_cast<double>(pdf_scatter_solid_angle(c.scene, y, to_light, y.wo, TransportMode::importance));
    const double merged_z = z.kind == Vertex::Kind::surface ? eta.surface : eta.medium;
    const double merged_y = y.kind == Vertex::Kind::surface ? eta.surface : eta.medium;
    const double light_sum = merged_z + sum_of<Heuristic>(z.mis, light_reverse, eta);
    const double eye_sum = merged_y + sum_of<Heuristic>(y.mis, eye_reverse, eta);
    out.weight = 1 / (1 + Heuristic::raise(light_step) * light_sum + Heuristic::raise(eye_step) * eye_sum);
    if (steps != nullptr) *steps = {0, light_step, light_reverse, eye_step, eye_reverse};
  }
  return true;
}

struct FilmPosition {
  float x = 0, y = 0;
};

// t = 1: the light's vertex z connected to a point on the lens. The value is for a film of splats filtered by
// PixelFilter::eval, one light path in the iteration: to be divided by their number.
template <Between kBetween, class Heuristic, class SamplerT>
bool connect_lens(const ConnectContext& c, SamplerT& sampler, std::uint32_t block, bool stratified,
                  const Vertex& z, const MergeFactors& eta, FilmPosition& film, Contribution& out,
                  Steps* steps = nullptr) {
  scene::CameraSample camera;
  const Vec2 u_lens = c.scene.reads_lens() ? sampler.draw_2d(block + kLens, stratified) : Vec2{0.5f, 0.5f};
  if (!c.scene.sample_camera(z.hit, u_lens, camera, c.rules.film_border)) return false;
  float pdf = 0;
  const Spectrum value = scatter_value(c.scene, z, z.wo, camera.wi, TransportMode::importance, pdf);
  if (value.is_black()) return false;
  double survival = 1;
  const Spectrum passed =
      visibility<kBetween>(c, z, camera.shadow_ray, passage_key<kBetween>(sampler, block, 0), survival);
  if (passed.is_black()) return false;
  film = {camera.film_x, camera.film_y};
  out.value = z.throughput * value * passed * (camera.importance / camera.pdf_solid_angle);
  out.weight = 1;
  if constexpr (Heuristic::kWeighs) {
    scene::CameraDensity density;
    double traced = 0, reverse = 0;
    if (c.scene.pdf_camera(z.hit.p, -camera.wi, density, c.rules.film_border)) {
      // The eye's walk's density of z: of one ray through every pixel.
      const double place = camera.delta_direction ? static_cast<double>(density.pdf_area)
                                                  : static_cast<double>(density.pdf_solid_angle) /
                                                        length_squared(Vec3d(z.hit.p) - Vec3d(camera.p));
      traced = c.rules.eye_paths * place * survival * static_cast<double>(z.density_factor(camera.wi));
      reverse =
          static_cast<double>(pdf_scatter_solid_angle(c.scene, z, camera.wi, z.wo, TransportMode::radiance));
    }
    double met = 0;
    if (c.rules.meets_lens && !camera.delta_position && !camera.delta_direction)
      met = static_cast<double>(pdf) / static_cast<double>(camera.pdf_solid_angle);
    const double merged = z.kind == Vertex::Kind::surface ? eta.surface : eta.medium;
    // Both divided by the number of samples this technique takes.
    const double rest = Heuristic::raise(traced) * (merged + sum_of<Heuristic>(z.mis, reverse, eta)) +
                        c.factors.hit_lens * Heuristic::raise(met);
    out.weight = 1 / (1 + rest / c.factors.light_image);
    if (steps != nullptr)
      *steps = {.next = c.factors.hit_lens * met / c.factors.light_image,
                .light_step = traced / c.factors.light_image,
                .light_reverse = reverse};
  }
  return true;
}

// t = 0: a light walk met the lens. steps: light_step is that of the vertex it came from, whose pdf_reverse
// is known. To be divided by the number of light paths.
template <class Heuristic, class WalkT>
Contribution hit_lens(const ConnectContext& c, const WalkT& walk, const MergeFactors& eta, FilmPosition& film,
                      Steps* steps = nullptr) {
  const auto& met = walk.lens();
  Contribution out;
  film = {met.camera.film_x, met.camera.film_y};
  out.value = met.throughput * met.camera.importance;
  out.weight = 1;
  if (met.edges < 2) return {};  // light seen directly is the eye's walk's alone
  if constexpr (Heuristic::kWeighs) {
    const Departure& d = walk.departure();
    const auto cosine = static_cast<double>(met.camera.cosine);
    const double distance_squared = std::max(length_squared(Vec3d(met.camera.p) - Vec3d(walk.from())),
                                             std::numeric_limits<double>::min());
    // Of the lens' point as the light walk finds it, without survival: see Walk::look_for_lens.
    const double found = d.pdf * cosine / distance_squared;
    const auto lens_area_pdf = static_cast<double>(met.camera.pdf_area);
    double rest = 0;
    if (d.connects > 0) rest = c.factors.light_image * Heuristic::raise(lens_area_pdf / found);
    // The eye's walk takes the same edge the other way, with survival.
    const double traced = lens_area_pdf * c.rules.eye_paths *
                          static_cast<double>(met.camera.pdf_solid_angle) * met.survival * d.leave / cosine;
    if (steps != nullptr)  // from the walk's last vertex on, where it left
      *steps = {.next = rest / c.factors.hit_lens, .light_step = traced / c.factors.hit_lens};
    rest += Heuristic::raise(traced) * (d.carried.pending + d.carried.pending_surface * eta.surface +
                                        d.carried.pending_medium * eta.medium);
    out.weight = 1 / (1 + rest / c.factors.hit_lens);
  }
  return out;
}

}  // namespace candela::transport
