#include "worker/scene/bsdfs/roughplastic.h"

#include <algorithm>
#include <cmath>

#include "worker/core/warp.h"
#include "worker/scene/bsdfs/fresnel.h"
#include "worker/scene/bsdfs/kinds.h"
#include "worker/scene/bsdfs/microfacet.h"

namespace candela::scene {
namespace {

struct Parts {
  float transmittance_o;
  float prob;  // of sampling the coat
};
bool parts(const RoughPlasticClosure& p, Vec3 wo, Parts& out) {
  out.transmittance_o = p.coat.transmittance(wo.z);
  const float r = (1 - out.transmittance_o) * p.specular_share;
  const float t = out.transmittance_o * (1 - p.specular_share);
  if (!(r + t > 0)) return false;
  out.prob = r / (r + t);
  return true;
}

Spectrum eval_pdf_of(const RoughPlasticClosure& p, const Parts& parts, Vec3 wo, Vec3 wi, float& pdf) {
  const float cosine = wi.z * math::kInvPi;
  pdf = (1 - parts.prob) * cosine;
  const Spectrum base = p.diffuse * (parts.transmittance_o * p.coat.transmittance(wi.z) * cosine);
  const Vec3 sum = wo + wi;
  const float len2 = length_squared(sum);
  if (!(len2 > 0)) return base;
  const Vec3 h = sum * (1 / std::sqrt(len2));
  const float cos_d = std::min(1.0f, dot(wo, h));
  if (!(cos_d > 0)) return base;
  const Microfacets m{p.alpha, p.alpha, p.ggx};
  const float d = m.D(h);
  if (d == 0) return base;
  const float masking_o = m.masking_over_cosine(wo);
  pdf += parts.prob * (p.sample_visible ? 0.25f * d * masking_o : 0.25f * d * h.z / std::max(cos_d, 1e-20f));
  float cos_t = 0;
  const float fresnel = fresnel_dielectric(cos_d, (1 - cos_d) * (1 + cos_d), p.eta, cos_t);
  return base + p.specular * (fresnel * 0.25f * d * masking_o * m.G1(wi));
}

}  // namespace

Spectrum eval_pdf(const RoughPlasticClosure& p, Vec3 wo, Vec3 wi, TransportMode /*mode*/, float& pdf) {
  pdf = 0;
  if (wo.z <= 0 || wi.z <= 0) return {};
  Parts parts_o;
  if (!parts(p, wo, parts_o)) return {};
  return eval_pdf_of(p, parts_o, wo, wi, pdf);
}

Spectrum eval_diffuse(const RoughPlasticClosure& p, Vec3 wo, Vec3 wi, TransportMode mode,
                      float glossy_below) {
  RoughPlasticClosure diffuse = p;
  if (p.alpha < glossy_below) diffuse.specular = {};
  float pdf = 0;
  return eval_pdf(diffuse, wo, wi, mode, pdf);
}

bool sample(const RoughPlasticClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode /*mode*/,
            BsdfSample& out) {
  if (wo.z <= 0) return false;
  Parts parts_o;
  if (!parts(p, wo, parts_o)) return false;
  if (u_lobe < parts_o.prob) {
    const Microfacets m{p.alpha, p.alpha, p.ggx};
    const Vec3 h = p.sample_visible ? m.sample_visible(wo, u) : m.sample_all(u);
    const float cos_d = dot(wo, h);
    if (!(cos_d > 0)) return false;
    const Vec3 reflected = h * (2 * cos_d) - wo;
    if (!(reflected.z > 0)) return false;
    out.wi = normalize(reflected);
  } else {
    out.wi = warp::cosine_hemisphere(u);
  }
  float pdf = 0;
  const Spectrum value = eval_pdf_of(p, parts_o, wo, out.wi, pdf);
  if (!(pdf > kMinDensity)) return false;
  out.pdf_solid_angle = pdf;
  out.weight = value * (1 / pdf);
  return true;
}

Result<void> RoughPlasticSurface::build(const description::Object& object, const BuildContext& context) {
  CANDELA_TRY(base.build(object, context));
  CANDELA_ASSIGN(const RoughnessParameters roughness, read_roughness(object, context.textures));
  alpha = roughness.alpha_u;
  ggx = roughness.ggx;
  sample_visible = roughness.sample_visible;
  const float most = std::max(kMinAlpha, alpha.maximum());
  if (!std::isfinite(most)) return located("the roughness is too large", object, "alpha");
  coats = CoatTables::between(std::max(kMinAlpha, alpha.minimum()), most, [&](float a) {
    return context.coats.get(ggx, std::max(kMinAlpha, a), base.eta);
  });
  // A file of 0.6 means what 0.6 does; the description says so.
  masked_light_stays = object.get_string("masked_light", "lost") == "stays";
  return {};
}

void RoughPlasticSurface::prepare(const SurfacePoint& at, bool below, Closure& out) const {
  RoughPlasticClosure p = {};
  p.alpha = std::max(kMinAlpha, alpha.eval(at));
  p.coat = coats.at(p.alpha);
  const auto inside = masked_light_stays ? p.coat.internal_return() : p.coat.internal_reflectance();
  const bool black = below || !base.prepare(at, inside, p.diffuse, p.specular, p.specular_share);
  p.eta = base.eta;
  p.ggx = ggx;
  p.sample_visible = sample_visible;
  out.set(p);
  out.black = black;
}

BsdfFacts RoughPlasticSurface::facts() const {
  return {.smooth = true,
          .max_albedo = base.max_albedo(),
          .min_roughness = base.specular.maximum().is_black() ? 1.0f : std::max(kMinAlpha, alpha.minimum())};
}

}  // namespace candela::scene
