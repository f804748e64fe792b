// A pane so thin that light leaves it where it came in: delta reflection, and transmission straight on. With
// R of one boundary, all orders of reflection inside add up to R' = R + T^2 R + T^2 R^3 + ... = 2 R / (1 + R)
// and T' = (1 - R) / (1 + R).
#pragma once

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/fresnel.h"

namespace candela::scene::thindielectric {

// R of one boundary; wo from either side.
inline float boundary(const DielectricParameters& p, Vec3 wo) {
  float cos_t = 0;
  return fresnel_dielectric(std::min(1.0f, std::abs(wo.z)), std::min(1.0f, wo.x * wo.x + wo.y * wo.y), p.eta,
                            cos_t);
}

inline Spectrum straight(const DielectricParameters& p, Vec3 wo) {
  const float r = boundary(p, wo);
  return p.transmittance * ((1 - r) / (1 + r));
}

inline bool sample(const DielectricParameters& p, Vec3 wo, float u_lobe, BsdfSample& out) {
  const float one = boundary(p, wo);
  const float reflected = 2 * one / (1 + one);
  const float passing = (1 - one) / (1 + one);
  const float r = reflected * p.reflectance.max_component();
  const float t = passing * p.transmittance.max_component();
  if (!(r + t > 0)) return false;
  const float prob_reflect = r / (r + t);
  out.delta = true;
  if (u_lobe < prob_reflect) {
    if (wo.z == 0) return false;
    out.wi = {-wo.x, -wo.y, wo.z};
    out.prob = out.prob_reverse = prob_reflect;
    out.weight = p.reflectance * (reflected / prob_reflect);
    return true;
  }
  out.wi = -wo;
  out.transmitted = true;
  out.straight = true;
  out.prob = out.prob_reverse = 1 - prob_reflect;
  out.weight = p.transmittance * (passing / (1 - prob_reflect));
  return out.prob > 0;
}

}  // namespace candela::scene::thindielectric
