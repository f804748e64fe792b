// Disney's principled material as Mitsuba 3 has it, after [Burley 2012] and [Burley 2015]: a diffuse part
// with retro-reflection, flattened towards a subsurface look, and sheen; a GGX lobe whose Fresnel term goes
// from dielectric over tinted to metallic; refraction through that same GGX surface; and a clearcoat lobe.
// From below there are the GGX lobe's reflection and refraction alone, and nothing without transmission.
//
// An artists' model: it is neither bounded by 1 in energy (the lobes are added) nor, for a clearcoat, a
// microfacet model (its 1 / (4 cos cos) is missing). What Mitsuba computes is kept.
//
// Sampling: the normal h of the GGX surface visible from wo, then reflection or refraction by Fresnel's
// reflectance there; or a normal of the clearcoat; or a cosine. Directions are evaluated mirrored to wo.z >
// 0.
#pragma once

#include <algorithm>
#include <cmath>

#include "worker/core/math.h"
#include "worker/core/warp.h"
#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/fresnel.h"
#include "worker/scene/bsdfs/microfacet.h"

namespace candela::scene::principled {

inline float schlick_weight(float cosine) {
  const float m = std::clamp(1 - cosine, 0.0f, 1.0f);
  return m * m * m * m * m;
}

inline float sine2(Vec3 h, Vec3 w) {
  return std::min(1.0f, length_squared(cross(h, w)));
}

// Fresnel's reflectance from both cosines: of a given half vector, and the same from either side.
inline float fresnel_between(float cos_i, float cos_t, float eta) {
  const float r_s = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
  const float r_p = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
  return std::min(1.0f, 0.5f * (r_s * r_s + r_p * r_p));
}

// The clearcoat's normals, GTR1 [Burley 2012, Eq. 4 with exponent 1]; coat_norm = (alpha^2 - 1) / (pi ln
// alpha^2).
inline float coat_density(const PrincipledParameters& p, Vec3 h) {
  const float alpha2 = p.coat_alpha * p.coat_alpha;
  return p.coat_norm / (h.x * h.x + h.y * h.y + alpha2 * h.z * h.z);
}
inline Vec3 sample_coat(const PrincipledParameters& p, Vec2 u) {
  const double alpha2 = static_cast<double>(p.coat_alpha) * static_cast<double>(p.coat_alpha);
  // sin^2 = alpha^2 (alpha^(-2 u) - 1) / (1 - alpha^2)
  const double sin2 = std::clamp(
      alpha2 * (math::exp(-static_cast<double>(u.y) * math::log(alpha2)) - 1) / (1 - alpha2), 0.0, 1.0);
  const auto r = static_cast<float>(std::sqrt(sin2));
  float s = 0;
  float c = 0;
  math::sincosf(2 * math::kPi * u.x, s, c);
  return {r * c, r * s, static_cast<float>(std::sqrt(1 - sin2))};
}

// GGX's masking of the clearcoat, always of roughness 1/4.
inline float coat_masking(Vec3 w) {
  return w.z * Microfacets{0.25f, 0.25f, true}.masking_over_cosine(w);
}

// The diffuse parts and sheen, without cos theta_i.
inline Spectrum eval_diffuse(const PrincipledParameters& p, Vec3 o, Vec3 i, float cos_d) {
  const float f_i = schlick_weight(i.z);
  const float f_o = schlick_weight(o.z);
  const float retro90 = 2 * p.roughness * cos_d * cos_d;
  // [Burley 2015, section 5.1]
  const float diffuse = (1 - 0.5f * f_o) * (1 - 0.5f * f_i);
  const float retro = retro90 * (f_i + f_o + f_i * f_o * (retro90 - 1));
  float base = diffuse + retro;
  if (p.flatness > 0) {
    // After Hanrahan and Krueger [Burley 2012].
    const float ss90 = 0.5f * retro90;
    const float ss = (1 + (ss90 - 1) * f_i) * (1 + (ss90 - 1) * f_o);
    const float flat = 1.25f * (ss * (1 / (o.z + i.z) - 0.5f) + 0.5f);
    base += p.flatness * (flat - base);
  }
  const Spectrum sheen = (Spectrum(p.sheen_white) + p.base * p.sheen_base) * schlick_weight(cos_d);
  return p.base * (p.diffuse * math::kInvPi * base) + sheen;
}

// o.z > 0, both mirrored if `inside`; h the half vector, h.z > 0: of reflection where i.z > 0, else of
// refraction.
inline Spectrum eval_pdf_mirrored(const PrincipledParameters& p, bool inside, Vec3 o, Vec3 i, Vec3 h,
                                  TransportMode mode, float& pdf) {
  pdf = 0;
  Spectrum value;
  const float o_h = dot(o, h);
  const float i_h = dot(i, h);
  const bool reflects = i.z > 0;
  if (!(o_h > 0) || !(reflects ? i_h > 0 : i_h < 0)) return {};
  const float eta = inside ? 1 / p.eta : p.eta;  // far side over o's side
  float cos_t = 0;
  const float cos_o = std::min(1.0f, o_h);
  const float fresnel = reflects ? fresnel_dielectric(cos_o, sine2(h, o), eta, cos_t)
                                 : fresnel_between(cos_o, std::min(1.0f, -i_h), eta);
  const Microfacets m{p.alpha_u, p.alpha_v, true};
  const float visible = m.D(h) * m.masking_over_cosine(o);  // density of h over dot(o, h)
  const float total = inside ? 1 : p.rate_specular + p.rate_coat + p.rate_diffuse;
  const float rate = (inside ? 1 : p.rate_specular) / total;
  const float passing = inside ? 1 : p.transmission;

  if (!reflects) {
    const float denominator = o_h + eta * i_h;
    const float squared = denominator * denominator;
    if (!(squared > 0) || !(fresnel < 1)) return {};
    const float jacobian = eta * eta * -i_h / squared;
    pdf = rate * passing * (1 - fresnel) * visible * o_h * jacobian;
    const float scale = mode == TransportMode::radiance ? 1 / (eta * eta) : 1.0f;
    const Spectrum colour = {std::sqrt(p.base.r), std::sqrt(p.base.g), std::sqrt(p.base.b)};
    return colour *
           (p.transmission * scale * (1 - fresnel) * visible * o_h * jacobian * m.G1({i.x, i.y, -i.z}));
  }

  pdf = rate * (1 - passing * (1 - fresnel)) * 0.25f * visible;
  const float lobe = 0.25f * visible * m.G1(i);
  if (inside) return Spectrum(p.transmission * fresnel * lobe);

  const float schlick = schlick_weight(eta > 1 ? cos_o : cos_t);
  if (fresnel > 0) {
    // Schlick's terms of metal and tint: F0 + (1 - F0) w, summed before.
    const Spectrum f0 = p.base * p.f0_base + Spectrum(p.f0_white);
    value = (f0 * (1 - schlick) + Spectrum(p.f90 * schlick + p.f_dielectric * fresnel)) * lobe;
  }
  if (p.coat > 0) {
    const float d = coat_density(p, h);
    pdf += p.rate_coat / total * d * h.z * 0.25f / i_h;
    value += Spectrum(p.coat * (0.04f + 0.96f * schlick) * d * coat_masking(o) * coat_masking(i) * i.z);
  }
  if (p.diffuse > 0) {
    pdf += p.rate_diffuse / total * i.z * math::kInvPi;
    value += eval_diffuse(p, o, i, cos_o) * i.z;
  }
  return value;
}

inline Spectrum eval_pdf(const PrincipledParameters& p, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf) {
  pdf = 0;
  if (wo.z == 0 || wi.z == 0) return {};
  const bool inside = wo.z < 0;
  if (inside) {
    if (!(p.transmission > 0)) return {};
    wo.z = -wo.z;
    wi.z = -wi.z;
  }
  if (wi.z < 0 && !(p.transmission > 0)) return {};
  Vec3 sum = wo + wi * (wi.z > 0 ? 1.0f : (inside ? 1 / p.eta : p.eta));
  const float len2 = length_squared(sum);
  if (!(len2 > 0)) return {};
  sum *= (sum.z < 0 ? -1 : 1) / std::sqrt(len2);
  return eval_pdf_mirrored(p, inside, wo, wi, sum, mode, pdf);
}

inline bool sample(const PrincipledParameters& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode,
                   BsdfSample& out) {
  if (wo.z == 0) return false;
  const bool inside = wo.z < 0;
  if (inside && !(p.transmission > 0)) return false;
  const Vec3 o = {wo.x, wo.y, std::abs(wo.z)};
  const float total = inside ? 1 : p.rate_specular + p.rate_coat + p.rate_diffuse;
  float x = inside ? u_lobe : u_lobe * total;
  Vec3 i;
  Vec3 h;
  bool given_h = false;
  if (!inside && x < p.rate_diffuse) {
    i = warp::cosine_hemisphere(u);
  } else if (!inside && x - p.rate_diffuse < p.rate_coat) {
    h = sample_coat(p, u);
    i = h * (2 * dot(o, h)) - o;
    if (!(i.z > 0)) return false;  // into the surface
    given_h = true;
  } else {
    if (!inside) x = std::min((x - p.rate_diffuse - p.rate_coat) / p.rate_specular, 0x1.fffffep-1f);
    h = Microfacets{p.alpha_u, p.alpha_v, true}.sample_visible(o, u);
    const float o_h = dot(o, h);
    if (!(o_h > 0)) return false;
    const float eta = inside ? 1 / p.eta : p.eta;
    float cos_t = 0;
    const float fresnel = fresnel_dielectric(std::min(1.0f, o_h), sine2(h, o), eta, cos_t);
    if (x < (inside ? 1 : p.transmission) * (1 - fresnel)) {
      i = h * (o_h / eta - cos_t) - o * (1 / eta);
      if (!(i.z < 0)) return false;
      out.transmitted = true;
      out.eta = eta;
    } else {
      i = h * (2 * o_h) - o;
      if (!(i.z > 0)) return false;
    }
    given_h = true;
  }
  i = normalize(i);
  if (!given_h) h = normalize(o + i);
  const Spectrum value = eval_pdf_mirrored(p, inside, o, i, h, mode, out.pdf_solid_angle);
  if (!(out.pdf_solid_angle > kLeastDensity)) return false;
  out.weight = value * (1 / out.pdf_solid_angle);
  out.wi = inside ? Vec3{i.x, i.y, -i.z} : i;
  return true;
}

}  // namespace candela::scene::principled
