#include "worker/scene/bsdfs/roughdielectric.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "worker/scene/bsdfs/fresnel.h"
#include "worker/scene/bsdfs/kinds.h"
#include "worker/scene/bsdfs/microfacet.h"

namespace candela::scene {
namespace {

// The probability of choosing reflection in a facet. False: nothing is left to choose.
bool prob_of_reflection(const RoughDielectricClosure& p, float fresnel, float& prob) {
  const float r = fresnel * p.reflectance.max_component();
  const float t = (1 - fresnel) * p.transmittance.max_component();
  if (!(r + t > 0)) return false;
  prob = r / (r + t);
  return true;
}

// Density of the facet normal h over 4 cos_o.
float pdf_normal(const RoughDielectricClosure& p, float masking_o, Vec3 h, float cos_o, float d) {
  return 0.25f * d * (p.sample_visible ? masking_o : h.z / std::max(cos_o, 1e-20f));
}

}  // namespace

Spectrum eval_pdf(const RoughDielectricClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf) {
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
  // Refraction knows both cosines; by Snell's law the other one would lose its digits at the critical
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

Spectrum eval_diffuse(const RoughDielectricClosure& p, Vec3 wo, Vec3 wi, TransportMode mode,
                      float glossy_below) {
  if (std::max(p.alpha_u, p.alpha_v) < glossy_below) return {};
  float pdf = 0;
  return eval_pdf(p, wo, wi, mode, pdf);
}

bool sample(const RoughDielectricClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode,
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

bool RoughDielectricSurface::matched() const {
  return std::abs(boundary.eta - 1) < kMatchedIndex;
}

Result<void> RoughDielectricSurface::build(const description::Object& object, const BuildContext& context) {
  CANDELA_TRY(boundary.build(object, context));
  CANDELA_ASSIGN(const RoughnessParameters roughness, read_roughness(object, context.textures));
  alpha_u = roughness.alpha_u;
  alpha_v = roughness.alpha_v;
  ggx = roughness.ggx;
  sample_visible = roughness.sample_visible;
  return {};
}

void RoughDielectricSurface::prepare(const SurfacePoint& at, bool /*below*/, Closure& out) const {
  const Spectrum reflectance = boundary.reflectance.eval(at);
  const Spectrum transmittance = boundary.transmittance.eval(at);
  if (matched()) {
    out.set(ThinDielectricClosure{reflectance, transmittance, 1});
    out.black = transmittance.is_black();
    return;
  }
  out.set(RoughDielectricClosure{reflectance, transmittance, boundary.eta,
                                 std::max(kMinAlpha, alpha_u.eval(at)), std::max(kMinAlpha, alpha_v.eval(at)),
                                 ggx, sample_visible});
  out.black = reflectance.is_black() && transmittance.is_black();
}

BsdfFacts RoughDielectricSurface::facts() const {
  const float passing = boundary.transmittance.maximum().max_component();
  if (matched()) return {.passthrough = passing > 0, .max_albedo = passing};
  return {.smooth = true,
          .transmissive = passing > 0,
          .max_albedo = std::max(boundary.reflectance.maximum().max_component(), passing),
          .min_roughness = std::max(kMinAlpha, std::min(alpha_u.minimum(), alpha_v.minimum()))};
}

}  // namespace candela::scene
