// Lambertian reflection, one-sided. Density: cosine.
#pragma once

#include "worker/core/warp.h"
#include "worker/scene/bsdf.h"

namespace candela::scene::diffuse {

inline Spectrum eval_pdf(const DiffuseParameters& p, Vec3 wo, Vec3 wi, float& pdf) {
  if (wo.z <= 0 || wi.z <= 0) {
    pdf = 0;
    return {};
  }
  pdf = wi.z * math::kInvPi;
  return p.reflectance * pdf;
}

inline bool sample(const DiffuseParameters& p, Vec3 wo, Vec2 u, BsdfSample& out) {
  if (wo.z <= 0) return false;
  out.wi = warp::cosine_hemisphere(u);
  out.pdf_solid_angle = out.wi.z * math::kInvPi;
  out.weight = p.reflectance;
  return true;
}

}  // namespace candela::scene::diffuse
