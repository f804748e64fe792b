#include "worker/scene/bsdfs/principled_thin.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "worker/core/math.h"
#include "worker/core/warp.h"
#include "worker/scene/bsdfs/fresnel.h"
#include "worker/scene/bsdfs/kinds.h"
#include "worker/scene/bsdfs/microfacet.h"
#include "worker/scene/bsdfs/principled_lobes.h"

namespace candela::scene {
namespace {

using namespace principled;

constexpr float kMinHalf2 = 1e-20f;  // of the sum of two directions, squared

// Burley 2015, figure 15: the roughness that a sheet's two surfaces have together for light that passes.
float through_roughness(float roughness, float eta) {
  return std::abs((0.65f * eta - 0.35f) * roughness);
}

// o.z > 0; `up`: i mirrored to i.z > 0. glossy: the weight of the lobes that do not bend light.
Spectrum eval_pdf_mirrored(const PrincipledThinClosure& p, float glossy, Vec3 o, Vec3 i, Vec3 up,
                           TransportMode mode, float& pdf) {
  pdf = 0;
  const bool reflects = i.z > 0;
  const Vec3 sum = o + up;
  if (!(length_squared(sum) > kMinHalf2)) return {};  // grazing and opposite: no facet lies between
  const Vec3 h = normalize(sum);
  const float cos_d = std::min(1.0f, dot(o, h));
  Spectrum value;
  pdf = (reflects ? p.prob_diffuse : 1 - p.prob_reflect - p.prob_through - p.prob_diffuse) * up.z *
        math::kInvPi;
  pdf = std::max(pdf, 0.0f);
  const float diffuse = 1 - p.specular;
  if (reflects) {
    const float reflected = diffuse * (1 - p.diffuse_through);
    if (reflected > 0)
      value = (p.base * (math::kInvPi * diffuse_factor(o.z, i.z, cos_d, p.roughness, p.flatness)) +
               p.sheen * schlick_weight(cos_d)) *
              (reflected * i.z);
  } else {
    value = p.base * (diffuse * p.diffuse_through * math::kInvPi * up.z);
  }
  if (!(glossy > 0)) return value;

  const Microfacets m =
      reflects ? Microfacets{p.alpha_u, p.alpha_v, true} : Microfacets{p.through_u, p.through_v, true};
  const float visible = m.D(h) * m.masking_over_cosine(o);  // density of h over dot(o, h)
  pdf += (reflects ? p.prob_reflect : p.prob_through) * 0.25f * visible;
  float cos_t = 0;
  const float fresnel = fresnel_dielectric(cos_d, sine2(h, o), p.eta, cos_t);
  const float lobe = glossy * 0.25f * visible * m.G1(up);
  if (reflects) {
    const float w = schlick_weight(p.eta > 1 ? cos_d : cos_t);
    const Spectrum tinted = (p.base * p.f0_base + Spectrum(p.f0_white)) * (1 - w) + Spectrum(w);
    return value + (Spectrum((1 - p.tint) * fresnel) + tinted * p.tint) * lobe;
  }
  // The light does not see the back of a facet. Only its direction is tested, as in Mitsuba, so the bsdf is
  // not reciprocal.
  const Vec3 light = mode == TransportMode::radiance ? up : o;
  if (!(light.x * h.x + light.y * h.y - light.z * h.z < 0)) return value;
  return value + p.base * ((1 - fresnel) * lobe);
}

}  // namespace

Spectrum eval_pdf(const PrincipledThinClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf) {
  pdf = 0;
  if (wo.z == 0 || wi.z == 0) return {};
  const float side = wo.z < 0 ? -1.0f : 1.0f;
  const Vec3 i = {wi.x, wi.y, side * wi.z};
  return eval_pdf_mirrored(p, p.specular, {wo.x, wo.y, std::abs(wo.z)}, i, {wi.x, wi.y, std::abs(wi.z)}, mode,
                           pdf);
}

Spectrum eval_diffuse(const PrincipledThinClosure& p, Vec3 wo, Vec3 wi, TransportMode mode,
                      float glossy_below) {
  const bool through = wo.z * wi.z < 0;
  const float roughness = through ? std::max(p.through_u, p.through_v) : std::max(p.alpha_u, p.alpha_v);
  float pdf = 0;
  if (!(roughness < glossy_below)) return eval_pdf(p, wo, wi, mode, pdf);
  if (wo.z == 0 || wi.z == 0) return {};
  const float side = wo.z < 0 ? -1.0f : 1.0f;
  const Vec3 i = {wi.x, wi.y, side * wi.z};
  return eval_pdf_mirrored(p, 0, {wo.x, wo.y, std::abs(wo.z)}, i, {wi.x, wi.y, std::abs(wi.z)}, mode, pdf);
}

bool sample(const PrincipledThinClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode,
            BsdfSample& out) {
  if (wo.z == 0) return false;
  const Vec3 o = {wo.x, wo.y, std::abs(wo.z)};
  const float specular = p.prob_reflect + p.prob_through;
  Vec3 up;
  bool through = false;
  if (u_lobe < specular) {
    through = u_lobe >= p.prob_reflect;
    const Microfacets m =
        through ? Microfacets{p.through_u, p.through_v, true} : Microfacets{p.alpha_u, p.alpha_v, true};
    const Vec3 h = m.sample_visible(o, u);
    up = h * (2 * dot(o, h)) - o;
    if (!(up.z > 0)) return false;
    up = normalize(up);
  } else {
    through = u_lobe >= specular + p.prob_diffuse && p.diffuse_through > 0;
    up = warp::cosine_hemisphere(u);
  }
  const Vec3 i = {up.x, up.y, through ? -up.z : up.z};
  const Spectrum value = eval_pdf_mirrored(p, p.specular, o, i, up, mode, out.pdf_solid_angle);
  if (!(out.pdf_solid_angle > kMinDensity)) return false;
  out.weight = value * (1 / out.pdf_solid_angle);
  out.wi = {i.x, i.y, wo.z < 0 ? -i.z : i.z};
  out.transmitted = through;
  return true;
}

Result<void> PrincipledThinSurface::build(const description::Object& object, const BuildContext& context) {
  CANDELA_ASSIGN(base_color, read_reflectance(object, context.textures, "base_color", 0.5f));
  CANDELA_ASSIGN(roughness, read_fraction(object, context.textures, "roughness", 0.5f));
  CANDELA_ASSIGN(anisotropic, read_fraction(object, context.textures, "anisotropic", 0));
  CANDELA_ASSIGN(spec_trans, read_fraction(object, context.textures, "spec_trans", 0));
  CANDELA_ASSIGN(spec_tint, read_fraction(object, context.textures, "spec_tint", 0));
  CANDELA_ASSIGN(sheen, read_fraction(object, context.textures, "sheen", 0));
  CANDELA_ASSIGN(sheen_tint, read_fraction(object, context.textures, "sheen_tint", 0));
  CANDELA_ASSIGN(flatness, read_fraction(object, context.textures, "flatness", 0));
  CANDELA_ASSIGN(diff_trans, context.textures.number(object, "diff_trans", 0));
  if (diff_trans.is_constant() && !(diff_trans.constant >= 0 && diff_trans.constant <= 2))
    return located("diff_trans lies between 0 and 2", object, "diff_trans");
  CANDELA_ASSIGN(eta, context.textures.number(object, "eta", 1.5f));
  if (!(eta.minimum() >= 1e-3f && eta.maximum() <= 1e3f))
    return located("eta is not within 0.001 and 1000", object, "eta");
  for (const auto& [name, rate] :
       {std::pair{"diffuse_reflectance_sampling_rate", &rate_diffuse},
        std::pair{"diffuse_transmittance_sampling_rate", &rate_diffuse_through},
        std::pair{"specular_reflectance_sampling_rate", &rate_specular},
        std::pair{"specular_transmittance_sampling_rate", &rate_specular_through}}) {
    const double value = object.get_number(name, 1);
    if (!(value >= 0 && value <= 1e6)) return located("a sampling rate lies between 0 and 1e6", object, name);
    *rate = std::max(kMinRate, static_cast<float>(value));
  }
  return {};
}

void PrincipledThinSurface::prepare(const SurfacePoint& at, bool /*below*/, Closure& out) const {
  PrincipledThinClosure p = {};
  p.base = base_color.eval(at);
  p.roughness = unit(roughness.eval(at));
  p.flatness = unit(flatness.eval(at));
  p.eta = eta.eval(at);
  const float along = unit(anisotropic.eval(at));
  std::tie(p.alpha_u, p.alpha_v) = ggx_alphas(p.roughness, along);
  std::tie(p.through_u, p.through_v) = ggx_alphas(through_roughness(p.roughness, p.eta), along);
  p.specular = unit(spec_trans.eval(at));
  p.diffuse_through = unit(0.5f * diff_trans.eval(at));

  // The hue of a color is the color over its luminance; of black, white.
  const float light = luminance(p.base);
  const bool has_hue = light > 1e-20f;
  p.tint = unit(spec_tint.eval(at));
  const float r0 = (p.eta - 1) / (p.eta + 1) * ((p.eta - 1) / (p.eta + 1));
  p.f0_base = has_hue ? r0 / light : 0;
  p.f0_white = has_hue ? 0 : r0;
  const float cloth = unit(sheen.eval(at));
  const float cloth_tint = has_hue ? unit(sheen_tint.eval(at)) : 0.0f;
  p.sheen = Spectrum(cloth * (1 - cloth_tint));
  if (has_hue) p.sheen += p.base * (cloth * cloth_tint / light);

  const float reflect = 0.5f * p.specular * rate_specular,
              through = 0.5f * p.specular * rate_specular_through;
  const float diffuse = (1 - p.specular) * (1 - p.diffuse_through) * rate_diffuse;
  const float diffuse_passes = (1 - p.specular) * p.diffuse_through * rate_diffuse_through;
  const float total = reflect + through + diffuse + diffuse_passes;
  p.prob_reflect = reflect / total;
  p.prob_through = through / total;
  p.prob_diffuse = diffuse_passes > 0 ? diffuse / total : 1 - p.prob_reflect - p.prob_through;
  out.set(p);
}

BsdfFacts PrincipledThinSurface::facts() const {
  const float rough = unit(roughness.minimum()), along = unit(anisotropic.maximum());
  const auto [u, v] = ggx_alphas(rough, along);
  const auto [through_u, through_v] = ggx_alphas(through_roughness(rough, eta.minimum()), along);
  const bool specular = spec_trans.maximum() > 0;
  // The lobes are added: a rough bound of each.
  const float base = base_color.maximum().max_component();
  return {.smooth = true,
          .transmissive = specular || diff_trans.maximum() > 0,
          .two_sided = true,
          .max_albedo = std::max(1.0f, base) + unit(sheen.maximum()),
          .min_roughness = specular ? std::min({1.0f, u, v, through_u, through_v}) : 1.0f};
}

}  // namespace candela::scene
