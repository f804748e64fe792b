#include "worker/scene/bsdfs/roughconductor.h"

#include <algorithm>
#include <cmath>

#include "worker/scene/bsdfs/fresnel.h"
#include "worker/scene/bsdfs/kinds.h"
#include "worker/scene/bsdfs/microfacet.h"

namespace candela::scene {
namespace {

float pdf_of(const RoughConductorClosure& p, const Microfacets& m, Vec3 wo, Vec3 h, float d) {
  if (p.sample_visible) return 0.25f * d * m.masking_over_cosine(wo);
  return 0.25f * d * h.z / std::max(dot(wo, h), 1e-20f);
}

}  // namespace

Spectrum eval_pdf(const RoughConductorClosure& p, Vec3 wo, Vec3 wi, TransportMode /*mode*/, float& pdf) {
  pdf = 0;
  if (wo.z <= 0 || wi.z <= 0) return {};
  const Vec3 sum = wo + wi;
  const float len2 = length_squared(sum);
  if (!(len2 > 0)) return {};
  const Vec3 h = sum * (1 / std::sqrt(len2));
  const float cos_d = dot(wo, h);
  if (!(cos_d > 0)) return {};
  const Microfacets m{p.alpha_u, p.alpha_v, p.ggx};
  const float d = m.D(h);
  if (d == 0) return {};
  const float masking_o = m.masking_over_cosine(wo);
  pdf = p.sample_visible ? 0.25f * d * masking_o : 0.25f * d * h.z / std::max(cos_d, 1e-20f);
  return p.reflectance * fresnel_conductor(std::min(1.0f, cos_d), p.eta, p.k) *
         (0.25f * d * masking_o * m.G1(wi));
}

Spectrum eval_diffuse(const RoughConductorClosure& p, Vec3 wo, Vec3 wi, TransportMode mode,
                      float glossy_below) {
  if (std::max(p.alpha_u, p.alpha_v) < glossy_below) return {};
  float pdf = 0;
  return eval_pdf(p, wo, wi, mode, pdf);
}

bool sample(const RoughConductorClosure& p, Vec3 wo, float /*u_lobe*/, Vec2 u, TransportMode /*mode*/,
            BsdfSample& out) {
  if (wo.z <= 0) return false;
  const Microfacets m{p.alpha_u, p.alpha_v, p.ggx};
  const Vec3 h = p.sample_visible ? m.sample_visible(wo, u) : m.sample_all(u);
  const float cos_d = dot(wo, h);
  if (!(cos_d > 0)) return false;
  const Vec3 reflected = h * (2 * cos_d) - wo;
  if (!(reflected.z > 0))
    return false;  // into the surface: the energy that a second bounce would carry is lost
  out.wi = normalize(reflected);
  const float d = m.D(h);
  if (!(d > 0)) return false;
  out.pdf_solid_angle = pdf_of(p, m, wo, h, d);
  const float geometry =
      p.sample_visible ? m.G1(out.wi) : m.masking_over_cosine(wo) * m.G1(out.wi) * cos_d / h.z;
  out.weight = p.reflectance * fresnel_conductor(std::min(1.0f, cos_d), p.eta, p.k) * geometry;
  return true;
}

Result<void> RoughConductorSurface::build(const description::Object& object, const BuildContext& context) {
  CANDELA_TRY(metal.build(object, context));
  CANDELA_ASSIGN(const RoughnessParameters roughness, read_roughness(object, context.textures));
  alpha_u = roughness.alpha_u;
  alpha_v = roughness.alpha_v;
  ggx = roughness.ggx;
  sample_visible = roughness.sample_visible;
  return {};
}

void RoughConductorSurface::prepare(const SurfacePoint& at, bool below, Closure& out) const {
  RoughConductorClosure p = {};
  if (!below)
    p = {metal.reflectance.eval(at),
         metal.eta.eval(at),
         metal.k.eval(at),
         std::max(kMinAlpha, alpha_u.eval(at)),
         std::max(kMinAlpha, alpha_v.eval(at)),
         ggx,
         sample_visible};
  out.set(p);
  out.black = p.reflectance.is_black();
}

BsdfFacts RoughConductorSurface::facts() const {
  return {.smooth = true,
          .max_albedo = metal.reflectance.maximum().max_component(),
          .min_roughness = std::max(kMinAlpha, std::min(alpha_u.minimum(), alpha_v.minimum()))};
}

}  // namespace candela::scene
