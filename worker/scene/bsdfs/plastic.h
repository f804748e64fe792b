// A diffuse base under a smooth dielectric coat, one-sided: a delta reflection off the coat, and a diffuse
// part of what gets in, scatters at the base and gets out again, after any number of reflections inside:
//   f |cos theta_i| = (1 - F(wo)) (1 - F(wi)) / eta^2  rho / (1 - rho F_in)  |cos theta_i| / pi
// where F_in is the mean reflectance of the coat for diffuse light from inside; not nonlinear: the base is
// taken to be of such a colour that rho is what is left, rho / (1 - F_in).
#pragma once

#include "worker/core/warp.h"
#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/fresnel.h"

namespace candela::scene::plastic {

inline float coat(const PlasticParameters& p, Vec3 w) {
  float cos_t = 0;
  return fresnel_dielectric(std::min(1.0f, w.z), std::min(1.0f, w.x * w.x + w.y * w.y), p.eta, cos_t);
}

// The probability of the coat's reflection, by the mean reflectances of both parts, as in Mitsuba. False:
// nothing is left to choose.
inline bool prob_of_coat(const PlasticParameters& p, float fresnel, float& prob) {
  const float r = fresnel * p.specular_share;
  const float t = (1 - fresnel) * (1 - p.specular_share);
  if (!(r + t > 0)) return false;
  prob = r / (r + t);
  return true;
}

inline Spectrum eval_pdf(const PlasticParameters& p, Vec3 wo, Vec3 wi, float& pdf) {
  pdf = 0;
  if (wo.z <= 0 || wi.z <= 0) return {};
  const float fresnel = coat(p, wo);
  float prob = 0;
  if (!prob_of_coat(p, fresnel, prob)) return {};
  const float cosine = wi.z * math::kInvPi;
  pdf = (1 - prob) * cosine;
  return p.diffuse * ((1 - fresnel) * (1 - coat(p, wi)) * cosine);
}

inline bool sample(const PlasticParameters& p, Vec3 wo, float u_lobe, Vec2 u, BsdfSample& out) {
  if (wo.z <= 0) return false;
  const float fresnel = coat(p, wo);
  float prob = 0;
  if (!prob_of_coat(p, fresnel, prob)) return false;
  if (u_lobe < prob) {
    out.wi = {-wo.x, -wo.y, wo.z};
    out.delta = true;
    out.prob = out.prob_reverse = prob;
    out.weight = p.specular * (fresnel / prob);
    return true;
  }
  if (!(prob < 1)) return false;
  out.wi = warp::cosine_hemisphere(u);
  out.pdf_solid_angle = (1 - prob) * (out.wi.z * math::kInvPi);
  out.weight = p.diffuse * ((1 - fresnel) * (1 - coat(p, out.wi)) / (1 - prob));
  return true;
}

}  // namespace candela::scene::plastic
