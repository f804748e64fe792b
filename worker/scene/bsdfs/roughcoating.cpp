#include "worker/scene/bsdfs/roughcoating.h"

#include <algorithm>
#include <cmath>

#include "worker/scene/bsdfs/bsdf_build.h"
#include "worker/scene/bsdfs/layer.h"
#include "worker/scene/bsdfs/microfacet.h"

namespace candela::scene {
namespace {

// The layer looks alike from both sides: its facets know the upper one.
Vec3 up(Vec3 w) {
  return {w.x, w.y, std::abs(w.z)};
}

float prob_coat(const RoughCoatingClosure& p, Vec3 w) {
  return prob_reflection(p.share, 1 - p.coat->transmittance(std::abs(w.z)));
}

// The layer's reflection, and the density of its sampling.
Spectrum coat_eval_pdf(const RoughCoatingClosure& p, Vec3 wo, Vec3 wi, float& pdf) {
  pdf = 0;
  const Vec3 sum = wo + wi;
  const float len2 = length_squared(sum);
  if (!(len2 > 0)) return {};
  const Vec3 h = sum * (1 / std::sqrt(len2));
  const float cos_d = std::min(1.0f, dot(wo, h));
  if (!(cos_d > 0)) return {};
  const Microfacets m{p.alpha, p.alpha, p.ggx};
  const float d = m.D(h);
  if (d == 0) return {};
  const float masking_o = m.masking_over_cosine(wo);
  pdf = p.sample_visible ? 0.25f * d * masking_o : 0.25f * d * h.z / std::max(cos_d, 1e-20f);
  float cos_t = 0;
  const float fresnel = fresnel_dielectric(cos_d, (1 - cos_d) * (1 + cos_d), p.eta, cos_t);
  return p.specular * (fresnel * 0.25f * d * masking_o * m.G1(wi));
}

Spectrum transmitted(const RoughCoatingClosure& p, Vec3 wo, Vec3 wi, const Refracted& o, const Refracted& i) {
  return absorbed(p.coat->transmittance(std::abs(wo.z)) * p.coat->transmittance(std::abs(wi.z)), p.absorption,
                  o, i);
}

}  // namespace

ClosureTraits RoughCoatingClosure::traits() const {
  const bool glossy = !specular.is_black();
  return {.purely_delta = !glossy && (below->black || below->purely_delta()),
          .has_delta = !below->black && below->has_delta_lobes(),
          .reads_lobe = true};
}

Spectrum eval_pdf(const RoughCoatingClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf) {
  pdf = 0;
  if (!(wo.z * wi.z > 0)) return {};
  const float prob = prob_coat(p, wo);
  Spectrum value;
  if (prob > 0) {
    value = coat_eval_pdf(p, up(wo), up(wi), pdf);
    pdf *= prob;
  }
  const Refracted o = refract_in(p.eta, wo), i = refract_in(p.eta, wi);
  if (!enters(o) || !enters(i)) return value;
  float pdf_below = 0;
  const Spectrum below = p.below->eval_pdf(o.inside, i.inside, mode, pdf_below);
  // Solid angle inside per solid angle outside.
  const float compression = std::abs(wi.z / i.inside.z) / (p.eta * p.eta);
  pdf += (1 - prob) * pdf_below * compression;
  return value + below * transmitted(p, wo, wi, o, i) * compression;
}

Spectrum eval_diffuse(const RoughCoatingClosure& p, Vec3 wo, Vec3 wi, TransportMode mode,
                      float glossy_below) {
  if (!(wo.z * wi.z > 0)) return {};
  float pdf = 0;
  const bool coat_is_diffuse = !(p.alpha < glossy_below) && prob_coat(p, wo) > 0;
  const Spectrum coat = coat_is_diffuse ? coat_eval_pdf(p, up(wo), up(wi), pdf) : Spectrum();
  const Refracted o = refract_in(p.eta, wo), i = refract_in(p.eta, wi);
  if (!enters(o) || !enters(i)) return coat;
  const float compression = std::abs(wi.z / i.inside.z) / (p.eta * p.eta);
  return coat + p.below->eval_diffuse(o.inside, i.inside, mode, glossy_below) * transmitted(p, wo, wi, o, i) *
                    compression;
}

bool sample(const RoughCoatingClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode,
            BsdfSample& out) {
  if (wo.z == 0) return false;
  const float prob = prob_coat(p, wo);
  if (u_lobe < prob) {
    const Microfacets m{p.alpha, p.alpha, p.ggx};
    const Vec3 above = up(wo);
    const Vec3 h = p.sample_visible ? m.sample_visible(above, u) : m.sample_all(u);
    const float cos_d = dot(above, h);
    if (!(cos_d > 0)) return false;
    const Vec3 reflected = h * (2 * cos_d) - above;
    if (!(reflected.z > 0)) return false;
    out.wi = normalize(reflected);
    out.wi.z = std::copysign(out.wi.z, wo.z);
  } else {
    const Refracted o = refract_in(p.eta, wo);
    if (!(prob < 1) || !enters(o)) return false;
    const float rest = std::min((u_lobe - prob) / (1 - prob), 0x1.fffffep-1f);
    if (!p.below->sample(o.inside, rest, u, mode, out)) return false;
    Vec3 wi;
    if (!refract_out(p.eta, out.wi, wi) || !(wo.z * wi.z > 0)) return false;
    out.wi = wi;
    if (out.delta) {
      const Refracted i = refract_in(p.eta, wi);
      if (!enters(i)) return false;
      out.weight *= transmitted(p, wo, wi, o, i) * (1 / (1 - prob));
      out.prob *= 1 - prob;
      out.prob_reverse *= 1 - prob_coat(p, wi);
      return true;
    }
  }
  const Spectrum value = eval_pdf(p, wo, out.wi, mode, out.pdf_solid_angle);
  if (!(out.pdf_solid_angle > kMinDensity)) return false;
  out.weight = value * (1 / out.pdf_solid_angle);
  return true;
}

Result<void> RoughCoatingSurface::build(const description::Object& object, const BuildContext& context) {
  CANDELA_TRY(build_coat("roughcoating", object, context));
  CANDELA_ASSIGN(const RoughnessParameters roughness, read_roughness(object, context.textures));
  alpha = std::max(kMinAlpha, roughness.alpha_u.constant);
  ggx = roughness.ggx;
  sample_visible = roughness.sample_visible;
  coat = context.coats.get(ggx, alpha, eta);
  return {};
}

void RoughCoatingSurface::prepare(const SurfaceHit& hit, Vec3 wo, ClosureArena& arena, Closure& out) const {
  RoughCoatingClosure p = {};
  prepare_coat(hit, wo, arena, p);
  p.coat = coat.get();
  p.alpha = alpha;
  p.ggx = ggx;
  p.sample_visible = sample_visible;
  out.set(p);
  out.black = is_black(p, wo);
}

BsdfFacts RoughCoatingSurface::facts() const {
  BsdfFacts facts = base->facts();
  const Spectrum gloss = specular.maximum();
  if (eta == 1 || gloss.is_black()) return facts;
  facts.smooth = true;
  facts.min_roughness = std::min(facts.min_roughness, alpha);
  facts.max_albedo = std::max(facts.max_albedo, gloss.max_component());
  return facts;
}

}  // namespace candela::scene
