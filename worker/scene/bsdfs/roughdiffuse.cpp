#include "worker/scene/bsdfs/roughdiffuse.h"

#include <algorithm>
#include <cmath>

#include "worker/core/math.h"
#include "worker/core/warp.h"
#include "worker/scene/bsdfs/kinds.h"

namespace candela::scene {
namespace {

// The two directions as the model sees them.
struct FacetAngles {
  float sin_alpha, sin_beta, tan_beta, cos_phi;
};

FacetAngles facet_angles(Vec3 wo, Vec3 wi) {
  const float sin_o = std::sqrt(wo.x * wo.x + wo.y * wo.y);
  const float sin_i = std::sqrt(wi.x * wi.x + wi.y * wi.y);
  const float both = sin_o * sin_i;
  const float cos_phi = both > 1e-8f ? std::clamp((wo.x * wi.x + wo.y * wi.y) / both, -1.0f, 1.0f) : 0.0f;
  // The larger angle has the smaller cosine.
  if (wo.z > wi.z) return {sin_i, sin_o, sin_o / wo.z, cos_phi};
  return {sin_o, sin_i, sin_i / wi.z, cos_phi};
}

// f pi
Spectrum facet_reflectance(const RoughDiffuseClosure& p, Vec3 wo, Vec3 wi) {
  const FacetAngles a = facet_angles(wo, wi);
  const float c1 = 1 - 0.5f * p.sigma2 / (p.sigma2 + 0.33f);
  const float ratio = p.sigma2 / (p.sigma2 + 0.09f);
  if (p.fast) {
    const float value = c1 + 0.45f * ratio * std::max(a.cos_phi, 0.0f) * a.sin_alpha * a.tan_beta;
    return p.reflectance * value;
  }
  const float alpha = math::asinf(std::min(1.0f, a.sin_alpha));
  const float beta = math::asinf(std::min(1.0f, a.sin_beta));
  const float two_beta = 2 * beta * math::kInvPi;
  const float c2 =
      0.45f * ratio * (a.cos_phi > 0 ? a.sin_alpha : a.sin_alpha - two_beta * two_beta * two_beta);
  const float angles = 4 * math::kInvPi * math::kInvPi * alpha * beta;
  const float c3 = 0.125f * ratio * angles * angles;
  const float c4 = 0.17f * p.sigma2 / (p.sigma2 + 0.13f);
  const float cosines = std::sqrt(std::max(0.0f, 1 - a.sin_alpha * a.sin_alpha)) +
                        std::sqrt(std::max(0.0f, 1 - a.sin_beta * a.sin_beta));
  // tan((alpha + beta) / 2); both at the horizon: tan(pi / 2) / the cosine's factor outside makes it vanish.
  const float tan_half = (a.sin_alpha + a.sin_beta) / std::max(cosines, 1e-7f);
  const float single = c1 + a.cos_phi * c2 * a.tan_beta + (1 - std::abs(a.cos_phi)) * c3 * tan_half;
  const float twice = c4 * (1 - a.cos_phi * two_beta * two_beta);
  return p.reflectance * std::max(0.0f, single) + p.reflectance * p.reflectance * std::max(0.0f, twice);
}

}  // namespace

Spectrum eval_pdf(const RoughDiffuseClosure& p, Vec3 wo, Vec3 wi, TransportMode /*mode*/, float& pdf) {
  pdf = 0;
  if (wo.z <= 0 || wi.z <= 0) return {};
  pdf = wi.z * math::kInvPi;
  return facet_reflectance(p, wo, wi) * pdf;
}

bool sample(const RoughDiffuseClosure& p, Vec3 wo, float /*u_lobe*/, Vec2 u, TransportMode /*mode*/,
            BsdfSample& out) {
  if (wo.z <= 0) return false;
  out.wi = warp::cosine_hemisphere(u);
  if (!(out.wi.z > 0)) return false;
  out.pdf_solid_angle = out.wi.z * math::kInvPi;
  out.weight = facet_reflectance(p, wo, out.wi);
  return true;
}

Result<void> RoughDiffuseSurface::build(const description::Object& object, const BuildContext& context) {
  CANDELA_ASSIGN(reflectance, read_reflectance(object, context.textures, "reflectance", 0.5f));
  CANDELA_ASSIGN(alpha, context.textures.number(object, "alpha", 0.2f));
  if (alpha.minimum() < 0) return located("roughness is not negative", object, "alpha");
  fast = object.get_bool("use_fast_approx", false);
  return {};
}

void RoughDiffuseSurface::prepare(const SurfacePoint& at, bool below, Closure& out) const {
  // 0.6 takes alpha for the root mean square slope of both axes together.
  const float roughness = below ? 0.0f : std::min(alpha.eval(at), 1e6f);
  const RoughDiffuseClosure p = {below ? Spectrum() : reflectance.eval(at), 0.5f * roughness * roughness,
                                 fast};
  out.set(p);
  out.black = p.reflectance.is_black();
}

BsdfFacts RoughDiffuseSurface::facts() const {
  // Interreflection in the facets makes up to c4 of 0.17 rho more, facing facets up to 0.45 more.
  const float most = reflectance.maximum().max_component();
  return {.smooth = true, .max_albedo = 2 * most};
}

}  // namespace candela::scene
