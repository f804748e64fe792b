// s = 1: next event estimation, a point on a light chosen as seen from the eye's vertex.
#pragma once

#include "worker/core/measure.h"
#include "worker/transport/technique/contribution.h"

namespace candela::transport {

// Next event estimation at the eye's vertex v, which is connectible.
template <EdgeContent kEdgeContent, class Mis, class SamplerT>
bool next_event(const ConnectContext& c, const VertexDraws<SamplerT>& draws,
                const Vertex<typename Mis::Block>& v, const MergeFactors& eta, Contribution& out,
                WeightTerms* terms = nullptr, Towards* towards = nullptr) {
  scene::DirectSample light;
  const float u_emitter = c.chooses_emitter ? draws.draw_1d(kEmitterChoice) : 0.0f;
  if (c.scene.sample_direct(v.hit, v.front, u_emitter, draws.draw_2d(kEmitterPoint), light) !=
      scene::DirectOutcome::sampled)
    return false;
  float pdf = 0;
  const Spectrum value = scatter_value(c.scene, v, v.wo, light.wi, TransportMode::radiance, pdf);
  if (value.is_black()) return false;
  double survival = 1;
  const Spectrum passed =
      visibility<kEdgeContent>(c, v, light.shadow_ray, passage_key<kEdgeContent>(c, draws), survival);
  if (passed.is_black()) return false;
  out.value = v.throughput * value * passed * light.radiance * (1 / light.pdf_solid_angle);
  out.weight = 1;
  if (towards != nullptr) *towards = {light.wi, light.emitter};
  if constexpr (Mis::kWeighs) {
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
        traced = solid_angle_to_perpendicular(traced, length_squared(Vec3d(v.hit.p) - Vec3d(light.p)));
      else if (!emission.infinite)
        traced = solid_angle_to_projected(traced, static_cast<double>(emission.cosine));
      reverse =
          static_cast<double>(pdf_scatter_solid_angle(c.scene, v, light.wi, v.wo, TransportMode::importance));
    }
    const double merged = merges_at<Mis>(c, SubpathOf::eye, v, light.wi, survival, eta);
    out.weight = 1 / (1 + c.factors.hit_light * Mis::raise(hit) +
                      Mis::raise(traced) * (merged + Mis::sum(v.mis, reverse, eta)));
    if (terms != nullptr)
      *terms = {.next = c.factors.hit_light * hit, .eye_step = traced, .eye_reverse = reverse};
  }
  return true;
}

}  // namespace candela::transport
