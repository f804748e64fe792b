// Light that the eye's walk meets (s = 0).
#pragma once

#include "worker/transport/connect.h"
#include "worker/transport/walk.h"

namespace candela::transport {

// Radiance arriving at the walk's last vertex from where advance() ended: a surface that emits, or the
// environment. before: that vertex, null for the camera.
template <class Heuristic>
bool hit_light(const ConnectContext& c, const Vertex& v, bool left, const Vertex* before,
               const MergeFactors& eta, Contribution& out, Steps* steps = nullptr) {
  out.weight = 1;
  if (left) {
    out.value = c.scene.environment(-v.wo);
    if (out.value.is_black()) return false;
    out.value *= v.throughput;
    if constexpr (Heuristic::kWeighs) {
      if (v.edges > 1) {
        scene::EmissionDensity emission;
        c.scene.pdf_emission_environment(-v.wo, emission);
        const double direct = v.previous_connects
                                  ? static_cast<double>(c.scene.pdf_direct_environment_solid_angle(
                                        before->hit, before->front, -v.wo))
                                  : 0;
        out.weight = weight_hit_light<Heuristic>(c, v, direct, emission, eta, steps);
      }
    }
    return true;
  }
  if (v.kind != Vertex::Kind::surface || v.hit.emitter == scene::kNone) return false;
  out.value = c.scene.emitted(v.hit, v.wo);
  if (out.value.is_black()) return false;
  out.value *= v.throughput;
  if constexpr (Heuristic::kWeighs) {
    if (v.edges > 1) {
      scene::EmissionDensity emission;
      c.scene.pdf_emission(v.hit, v.wo, emission);
      const double direct =
          v.previous_connects
              ? static_cast<double>(c.scene.pdf_direct_solid_angle(before->hit, before->front, -v.wo, v.hit))
              : 0;
      out.weight = weight_hit_light<Heuristic>(c, v, direct, emission, eta, steps);
    }
  }
  return true;
}

}  // namespace candela::transport
