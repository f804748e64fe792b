// A bsdf in a turned shading frame, as bump and normal maps leave it. Directions that lie on different sides
// of the two frames' planes exchange nothing, so that no light leaks through the surface; as Mitsuba has it.
#pragma once

#include "worker/scene/bsdf.h"

namespace candela::scene::perturbed {

inline Spectrum eval_pdf(const PerturbedParameters& p, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf) {
  pdf = 0;
  const Vec3 turned_wo = p.frame.to_local(wo);
  const Vec3 turned_wi = p.frame.to_local(wi);
  if (!(turned_wo.z * wo.z > 0 && turned_wi.z * wi.z > 0)) return {};
  return p.nested->eval_pdf(turned_wo, turned_wi, mode, pdf);
}

inline bool sample(const PerturbedParameters& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode,
                   BsdfSample& out) {
  const Vec3 turned_wo = p.frame.to_local(wo);
  if (!(turned_wo.z * wo.z > 0)) return false;
  if (!p.nested->sample(turned_wo, u_lobe, u, mode, out)) return false;
  if (out.straight) {
    out.wi = -wo;
    return true;
  }
  const float turned_z = out.wi.z;
  out.wi = normalize(p.frame.to_world(out.wi));
  return out.wi.z * turned_z > 0;
}

}  // namespace candela::scene::perturbed
