// s = 0: the eye's walk meets light.
#pragma once

#include "worker/transport/technique/contribution.h"

namespace candela::transport {

// s = 0, the weight. v: where the eye's walk met light. direct_pdf_solid_angle: with which next event
// estimation at the vertex before would have found it, 0 where that is not run; emission: of that light
// leaving this way.
template <class Mis>
double weight_hit_light(const ConnectContext& c, const Vertex<typename Mis::Block>& v,
                        double direct_pdf_solid_angle, const scene::EmissionDensity& emission,
                        const MergeFactors& eta, WeightTerms* terms = nullptr) {
  if (v.edges == 1) return 1;  // seen directly: no other technique is run for these
  double rest = 0;
  if (v.previous_connects) rest = c.factors.next_event * Mis::raise(direct_pdf_solid_angle / v.pdf_arrival);
  const double traced = static_cast<double>(emission.prob) * static_cast<double>(emission.pdf_area) *
                        static_cast<double>(emission.pdf_solid_angle);
  if (terms != nullptr) *terms = {.next = rest, .eye_step = 1, .eye_reverse = traced};
  auto block = v.mis;
  block.known = 0;  // that of a connection, whose place next event estimation takes
  rest += Mis::sum(block, traced, eta);
  return 1 / (1 + rest);
}

// Radiance arriving at the walk's last vertex from where advance() ended: a surface that emits, or the
// environment. before: that vertex, null for the camera.
template <class Mis>
bool hit_light(const ConnectContext& c, const Vertex<typename Mis::Block>& v, bool left,
               const ScatterPoint* before, const MergeFactors& eta, Contribution& out,
               WeightTerms* terms = nullptr) {
  out.weight = 1;
  if (left) {
    out.value = c.scene.environment(-v.wo);
    if (out.value.is_black()) return false;
    out.value *= v.throughput;
    if constexpr (Mis::kWeighs) {
      if (v.edges > 1) {
        scene::EmissionDensity emission;
        c.scene.pdf_emission_environment(-v.wo, emission);
        const double direct = v.previous_connects
                                  ? static_cast<double>(c.scene.pdf_direct_environment_solid_angle(
                                        before->hit, before->front, -v.wo))
                                  : 0;
        out.weight = weight_hit_light<Mis>(c, v, direct, emission, eta, terms);
      }
    }
    return true;
  }
  if (!v.on_surface() || v.hit.emitter == scene::kNone) return false;
  out.value = c.scene.emitted(v.hit, v.wo);
  if (out.value.is_black()) return false;
  out.value *= v.throughput;
  if constexpr (Mis::kWeighs) {
    if (v.edges > 1) {
      scene::EmissionDensity emission;
      c.scene.pdf_emission(v.hit, v.wo, emission);
      const double direct =
          v.previous_connects
              ? static_cast<double>(c.scene.pdf_direct_solid_angle(before->hit, before->front, -v.wo, v.hit))
              : 0;
      out.weight = weight_hit_light<Mis>(c, v, direct, emission, eta, terms);
    }
  }
  return true;
}

}  // namespace candela::transport
