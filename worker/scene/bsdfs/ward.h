// Ward's anisotropic reflection as Mitsuba 0.6 has it, over a diffuse part; one-sided. With D Beckmann's
// density of the half vector h, the lobe is
//
// ward       D h.z^4 / (4 sqrt(cos theta_i cos theta_o))  [Ward 1992]
// ward-duer  D h.z^4 / (4 cos theta_i cos theta_o)        [Duer 2006]
// balanced   D / (4 dot(wo, h)^2)                         [Geisler and Duer 2010]
//
// The first loses light at grazing angles and the second makes some; the third keeps below 1. All are
// sampled by h with density D h.z.
#pragma once

#include <algorithm>
#include <cmath>

#include "worker/core/warp.h"
#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/microfacet.h"

namespace candela::scene::ward {

// cos theta_i times the lobe, but for D.
inline float shape(const WardParameters& p, Vec3 wo, Vec3 wi, float h_z, float cos_d) {
  const float z4 = h_z * h_z * h_z * h_z;
  // The first two are infinite at grazing views.
  const float cos_o = std::max(wo.z, 1e-6f);
  switch (p.variant) {
    case WardVariant::ward:
      return 0.25f * z4 * std::sqrt(wi.z / cos_o);
    case WardVariant::ward_duer:
      return 0.25f * z4 / cos_o;
    case WardVariant::balanced:
      break;
  }
  return 0.25f * wi.z / (cos_d * cos_d);
}

inline Spectrum eval_pdf(const WardParameters& p, Vec3 wo, Vec3 wi, float& pdf) {
  pdf = 0;
  if (wo.z <= 0 || wi.z <= 0) return {};
  const float cosine = wi.z * math::kInvPi;
  pdf = (1 - p.prob_specular) * cosine;
  Spectrum value = p.diffuse * cosine;
  const Vec3 sum = wo + wi;
  const float len2 = length_squared(sum);
  if (!(len2 > 0)) return value;
  const Vec3 h = sum * (1 / std::sqrt(len2));
  const float cos_d = std::max(dot(wo, h), 1e-6f);
  const float d = Microfacets{p.alpha_u, p.alpha_v, false}.D(h);
  pdf += p.prob_specular * 0.25f * d * h.z / cos_d;
  value += p.specular * (d * shape(p, wo, wi, h.z, cos_d));
  return value;
}

inline bool sample(const WardParameters& p, Vec3 wo, float u_lobe, Vec2 u, BsdfSample& out) {
  if (wo.z <= 0) return false;
  if (u_lobe < p.prob_specular) {
    const Vec3 h = Microfacets{p.alpha_u, p.alpha_v, false}.sample_all(u);
    const float cos_d = dot(wo, h);
    if (!(cos_d > 0)) return false;
    const Vec3 reflected = h * (2 * cos_d) - wo;
    if (!(reflected.z > 0)) return false;  // into the surface
    out.wi = normalize(reflected);
  } else {
    out.wi = warp::cosine_hemisphere(u);
  }
  const Spectrum value = eval_pdf(p, wo, out.wi, out.pdf_solid_angle);
  if (!(out.pdf_solid_angle > kLeastDensity)) return false;
  out.weight = value * (1 / out.pdf_solid_angle);
  return true;
}

}  // namespace candela::scene::ward
