// The modified Phong model of Lafortune and Willems, as Mitsuba 0.6 has it: a diffuse part and a lobe
// cos^n around the mirror direction, normalised to reflect its colour at normal incidence; one-sided.
//
// f |cos theta_i| = (diffuse / pi + specular (n + 2) / (2 pi) cos^n alpha) cos theta_i
// [Lafortune and Willems 1994]
#pragma once

#include <algorithm>

#include "worker/core/math.h"
#include "worker/core/warp.h"
#include "worker/scene/bsdf.h"

namespace candela::scene::phong {

// cos^n of the angle between unit vectors. From their difference: for large n the cosine as a float has too
// few digits.
inline float cosine_power(Vec3 a, Vec3 b, float exponent) {
  const Vec3d difference = Vec3d(a) - Vec3d(b);
  const double cosine = 1 - 0.5 * length_squared(difference);
  if (!(cosine > 0)) return 0;
  return static_cast<float>(math::exp(static_cast<double>(exponent) * math::log(cosine)));
}

inline Spectrum eval_pdf(const PhongParameters& p, Vec3 wo, Vec3 wi, float& pdf) {
  pdf = 0;
  if (wo.z <= 0 || wi.z <= 0) return {};
  const float power = cosine_power(wi, {-wo.x, -wo.y, wo.z}, p.exponent) * (0.5f * math::kInvPi);
  const float cosine = wi.z * math::kInvPi;
  pdf = p.prob_specular * (p.exponent + 1) * power + (1 - p.prob_specular) * cosine;
  return p.diffuse * cosine + p.specular * ((p.exponent + 2) * power * wi.z);
}

inline bool sample(const PhongParameters& p, Vec3 wo, float u_lobe, Vec2 u, BsdfSample& out) {
  if (wo.z <= 0) return false;
  if (u_lobe < p.prob_specular) {
    const double log_cosine = math::log(1 - static_cast<double>(u.y)) / (static_cast<double>(p.exponent) + 1);
    const auto z = static_cast<float>(math::exp(log_cosine));
    const auto r = static_cast<float>(std::sqrt(std::max(0.0, 1 - math::exp(2 * log_cosine))));
    float s = 0;
    float c = 0;
    math::sincosf(2 * math::kPi * u.x, s, c);
    out.wi = normalize(make_frame({-wo.x, -wo.y, wo.z}).to_world({r * c, r * s, z}));
    if (!(out.wi.z > 0)) return false;  // into the surface
  } else {
    out.wi = warp::cosine_hemisphere(u);
  }
  const Spectrum value = eval_pdf(p, wo, out.wi, out.pdf_solid_angle);
  if (!(out.pdf_solid_angle > kLeastDensity)) return false;
  out.weight = value * (1 / out.pdf_solid_angle);
  return true;
}

}  // namespace candela::scene::phong
