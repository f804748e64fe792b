// A rough boundary between two dielectrics: the microfacet model of Walter et al. 2007 with Smith's separable
// masking. A facet normal h is chosen first, then reflection or refraction in it by Fresnel's reflectance
// times the lobes' colours.
//
// With cos_o = wo.h, cos_t = |wi.h| of refraction, eta the far side's index over wo's side's, and D G in h:
//   reflection  f |cos theta_i| = F D G / (4 cos theta_o)                                  [Walter 2007, Eq.
//   20] refraction  f |cos theta_i| = (1 - F) D G cos_o cos_t eta^2 / (cos theta_o (cos_o - eta cos_t)^2)
//               for importance [Walter 2007, Eq. 21], 1/eta^2 of that for radiance [Veach 1997, ch. 5]
// and the density of wi is that of h times dh/dwi = 1 / (4 cos_o) or eta^2 cos_t / (cos_o - eta cos_t)^2.
// Both are reciprocal: f(wo, wi) / eta_o^2 = f(wi, wo) / eta_i^2.
#pragma once

#include <limits>

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/fresnel.h"
#include "worker/scene/bsdfs/microfacet.h"

namespace candela::scene::roughdielectric {

// The probability of choosing reflection in a facet. False: nothing is left to choose.
inline bool prob_of_reflection(const RoughDielectricParameters& p, float fresnel, float& prob) {
  const float r = fresnel * p.reflectance.max_component();
  const float t = (1 - fresnel) * p.transmittance.max_component();
  if (!(r + t > 0)) return false;
  prob = r / (r + t);
  return true;
}

// Density of the facet normal h over 4 cos_o.
inline float pdf_normal(const RoughDielectricParameters& p, float masking_o, Vec3 h, float cos_o, float d) {
  return 0.25f * d * (p.sample_visible ? masking_o : h.z / std::max(cos_o, 1e-20f));
}

inline Spectrum eval_pdf(const RoughDielectricParameters& p, Vec3 wo, Vec3 wi, TransportMode mode,
                         float& pdf) {
  pdf = 0;
  if (wo.z == 0 || wi.z == 0) return {};
  const float eta = wo.z > 0 ? p.eta : 1 / p.eta;
  // Mirrored, so that wo lies above: the facets look the same from below.
  if (wo.z < 0) {
    wo.z = -wo.z;
    wi.z = -wi.z;
  }
  const bool reflected = wi.z > 0;
  // In double: for an index close to 1 the sum nearly cancels.
  const Vec3d sum = Vec3d(wo) + Vec3d(wi) * (reflected ? 1.0 : static_cast<double>(eta));
  const double len2 = length_squared(sum);
  if (!(len2 > 0) || sum.z == 0) return {};
  const Vec3 h = Vec3(sum * ((sum.z < 0 ? -1 : 1) / std::sqrt(len2)));
  const float cos_o = dot(wo, h);
  const float cos_i = dot(wi, h);
  if (!(cos_o > 0) || reflected != (cos_i > 0)) return {};
  // Of refraction both cosines are known; by Snell's law the other one would lose its digits at the critical
  // angle.
  float cos_t = 0;
  const float fresnel = reflected ? fresnel_dielectric(std::min(1.0f, cos_o),
                                                       std::max(0.0f, (1 - cos_o) * (1 + cos_o)), eta, cos_t)
                                  : fresnel_of_cosines(cos_o, -cos_i, eta);
  float prob = 0;
  if (!prob_of_reflection(p, fresnel, prob)) return {};
  const Microfacets m{p.alpha_u, p.alpha_v, p.ggx};
  const float d = m.D(h);
  if (d == 0) return {};
  const float masking_o = m.masking_over_cosine(wo);
  const float normal = pdf_normal(p, masking_o, h, cos_o, d);
  if (reflected) {
    pdf = prob * normal;
    return p.reflectance * (fresnel * 0.25f * d * masking_o * m.G1(wi));
  }
  // (cos_o - eta cos_t)^2 is the squared length of the sum.
  const auto jacobian = static_cast<float>(-4.0 * static_cast<double>(eta) * eta * cos_i * cos_o / len2);
  pdf = (1 - prob) * normal * jacobian;
  const float scale = mode == TransportMode::radiance ? 1 / (eta * eta) : 1.0f;
  return p.transmittance *
         ((1 - fresnel) * 0.25f * d * masking_o * m.G1({wi.x, wi.y, -wi.z}) * jacobian * scale);
}

inline bool sample(const RoughDielectricParameters& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode,
                   BsdfSample& out) {
  if (wo.z == 0) return false;
  const bool below = wo.z < 0;
  const float eta = below ? 1 / p.eta : p.eta;
  if (below) wo.z = -wo.z;
  const Microfacets m{p.alpha_u, p.alpha_v, p.ggx};
  const Vec3 h = p.sample_visible ? m.sample_visible(wo, u) : m.sample_all(u);
  const float cos_o = dot(wo, h);
  if (!(cos_o > 0)) return false;
  float cos_t = 0;
  const float fresnel =
      fresnel_dielectric(std::min(1.0f, cos_o), std::max(0.0f, (1 - cos_o) * (1 + cos_o)), eta, cos_t);
  float prob = 0;
  if (!prob_of_reflection(p, fresnel, prob)) return false;
  const float d = m.D(h);
  if (!(d > 0)) return false;
  const float masking_o = m.masking_over_cosine(wo);
  const float normal = pdf_normal(p, masking_o, h, cos_o, d);
  Spectrum weight;
  if (u_lobe < prob) {
    const Vec3 reflected = h * (2 * cos_o) - wo;
    // Into the surface: the energy that a second bounce would carry is lost.
    if (!(reflected.z > 0)) return false;
    out.wi = normalize(reflected);
    out.pdf_solid_angle = prob * normal;
    weight = p.reflectance * (fresnel / prob * m.G1(out.wi));
  } else {
    const float ratio = 1 / eta;
    const Vec3 refracted = h * (cos_o * ratio - cos_t) - wo * ratio;
    if (!(refracted.z < 0) || cos_t == 0) return false;
    out.wi = normalize(refracted);
    out.transmitted = true;
    out.eta = eta;
    const double difference = static_cast<double>(cos_o) - static_cast<double>(eta) * cos_t;
    out.pdf_solid_angle = static_cast<float>((1 - prob) * normal * 4.0 * static_cast<double>(eta) * eta *
                                             cos_t * cos_o / (difference * difference));
    const float scale = mode == TransportMode::radiance ? ratio * ratio : 1.0f;
    weight = p.transmittance * ((1 - fresnel) / (1 - prob) * scale * m.G1({out.wi.x, out.wi.y, -out.wi.z}));
  }
  if (!(out.pdf_solid_angle > 0 && out.pdf_solid_angle < std::numeric_limits<float>::infinity()))
    return false;
  out.weight = p.sample_visible ? weight : weight * (masking_o * cos_o / h.z);
  if (below) out.wi.z = -out.wi.z;
  return true;
}

}  // namespace candela::scene::roughdielectric
