// Light from a place without extent (point, spot): whichever ray would meet it, only a choice of it finds it.
#pragma once

#include <cmath>

#include "worker/core/vec.h"
#include "worker/scene/emitters/emitter.h"

namespace candela::scene {

// intensity(d): W / sr towards d (unit, world).
template <class Intensity>
DirectOutcome sample_place(Vec3 position, const SurfaceHit& reference, Vec3 front, const Intensity& intensity,
                           DirectSample& out) {
  const Vec3 v = position - reference.p;
  const float d2 = length_squared(v);
  if (!(d2 > 0)) return DirectOutcome::failed;
  out.wi = v / std::sqrt(d2);
  out.p = position;
  out.ng = {};
  out.radiance = intensity(-out.wi) / d2;
  out.pdf_solid_angle = 1;
  out.delta = true;
  out.infinite = false;
  if (!faces(front, out.wi)) {
    out.radiance = {};
    return DirectOutcome::dark;
  }
  out.shadow_ray = spawn_shadow_ray(reference, position, {0, 0, 0}, 0);
  return out.radiance.is_black() ? DirectOutcome::dark : DirectOutcome::sampled;
}

// Fills vertex and ray of light that leaves the place along d.
inline void start_at(Vec3 position, Vec3 d, EmissionSample& out) {
  out.vertex.p = position;
  out.vertex.ng = d;
  out.vertex.shading = make_frame(d);
  out.ray = {position, d};
}

// The density of light leaving along a direction that has this density.
inline bool pdf_emission_place(float pdf_solid_angle, EmissionDensity& out) {
  out.cosine = 1;
  out.delta_position = true;
  out.pdf_area = 1;
  out.pdf_solid_angle = pdf_solid_angle;
  return out.prob > 0 && out.pdf_solid_angle > 0;
}

}  // namespace candela::scene
