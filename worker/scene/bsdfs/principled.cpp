#include "worker/scene/bsdfs/principled.h"

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

float coat_alpha_of(float gloss) {
  return 0.1f + gloss * (0.001f - 0.1f);
}

// Fresnel's reflectance from both cosines: of a given half vector, and the same from either side.
float fresnel_between(float cos_i, float cos_t, float eta) {
  const float r_s = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
  const float r_p = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
  return std::min(1.0f, 0.5f * (r_s * r_s + r_p * r_p));
}

// The clearcoat's normals, GTR1 [Burley 2012, Eq. 4 with exponent 1]; coat_norm = (alpha^2 - 1) / (pi ln
// alpha^2).
float coat_density(const PrincipledClosure& p, Vec3 h) {
  const float alpha2 = p.coat_alpha * p.coat_alpha;
  return p.coat_norm / (h.x * h.x + h.y * h.y + alpha2 * h.z * h.z);
}
Vec3 sample_coat(const PrincipledClosure& p, Vec2 u) {
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
float coat_masking(Vec3 w) {
  return w.z * Microfacets{0.25f, 0.25f, true}.masking_over_cosine(w);
}

// The diffuse parts and sheen, without cos theta_i.
Spectrum eval_diffuse(const PrincipledClosure& p, Vec3 o, Vec3 i, float cos_d) {
  const float base = diffuse_factor(o.z, i.z, cos_d, p.roughness, p.flatness);
  const Spectrum sheen = (Spectrum(p.sheen_white) + p.base * p.sheen_base) * schlick_weight(cos_d);
  return p.base * (p.diffuse * math::kInvPi * base) + sheen;
}

// o.z > 0, both mirrored if `inside`; h the half vector, h.z > 0: of reflection where i.z > 0, else of
// refraction.
Spectrum eval_pdf_mirrored(const PrincipledClosure& p, bool inside, Vec3 o, Vec3 i, Vec3 h,
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
    const Spectrum color = {std::sqrt(p.base.r), std::sqrt(p.base.g), std::sqrt(p.base.b)};
    return color *
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

}  // namespace

Spectrum eval_pdf(const PrincipledClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float& pdf) {
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

Spectrum eval_diffuse(const PrincipledClosure& p, Vec3 wo, Vec3 wi, TransportMode mode, float glossy_below) {
  PrincipledClosure diffuse = p;
  if (std::max(p.alpha_u, p.alpha_v) < glossy_below)
    diffuse.f0_base = diffuse.f0_white = diffuse.f90 = diffuse.f_dielectric = diffuse.transmission = 0;
  if (p.coat_alpha < glossy_below) diffuse.coat = 0;
  float pdf = 0;
  return eval_pdf(diffuse, wo, wi, mode, pdf);
}

bool sample(const PrincipledClosure& p, Vec3 wo, float u_lobe, Vec2 u, TransportMode mode, BsdfSample& out) {
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
  if (!(out.pdf_solid_angle > kMinDensity)) return false;
  out.weight = value * (1 / out.pdf_solid_angle);
  out.wi = inside ? Vec3{i.x, i.y, -i.z} : i;
  return true;
}

Result<void> PrincipledSurface::build(const description::Object& object, const BuildContext& context) {
  CANDELA_ASSIGN(base_color, read_reflectance(object, context.textures, "base_color", 0.5f));
  CANDELA_ASSIGN(roughness, read_fraction(object, context.textures, "roughness", 0.5f));
  CANDELA_ASSIGN(anisotropic, read_fraction(object, context.textures, "anisotropic", 0));
  CANDELA_ASSIGN(metallic, read_fraction(object, context.textures, "metallic", 0));
  CANDELA_ASSIGN(spec_trans, read_fraction(object, context.textures, "spec_trans", 0));
  CANDELA_ASSIGN(spec_tint, read_fraction(object, context.textures, "spec_tint", 0));
  CANDELA_ASSIGN(sheen, read_fraction(object, context.textures, "sheen", 0));
  CANDELA_ASSIGN(sheen_tint, read_fraction(object, context.textures, "sheen_tint", 0));
  CANDELA_ASSIGN(flatness, read_fraction(object, context.textures, "flatness", 0));
  CANDELA_ASSIGN(clearcoat, read_fraction(object, context.textures, "clearcoat", 0));
  CANDELA_ASSIGN(clearcoat_gloss, read_fraction(object, context.textures, "clearcoat_gloss", 0));
  const bool passes = spec_trans.maximum() > 0;
  if (given(object, "eta")) {
    if (given(object, "specular"))
      return located("eta excludes specular", object, "eta").with_mend("give either");
    eta = static_cast<float>(object.get_number("eta", 1.5));
    // An index-matched boundary would not scatter: Mitsuba's values there.
    if (passes && eta == 1) eta = 1.001f;
  } else {
    double specular = object.get_number("specular", 0.5);
    if (!(specular >= 0 && specular <= 1))
      return located("specular lies between 0 and 1", object, "specular");
    if (passes && specular == 0) specular = 1e-3;
    eta = static_cast<float>(2 / (1 - std::sqrt(0.08 * specular)) - 1);
  }
  if (!(eta >= 1e-3f && eta <= 1e3f))
    return located("eta is " + shown(eta) + "; from 0.001 to 1000 is supported", object, "eta");
  for (const auto& [name, rate] : {std::pair{"diffuse_reflectance_sampling_rate", &rate_diffuse},
                                   std::pair{"clearcoat_sampling_rate", &rate_coat},
                                   std::pair{"main_specular_sampling_rate", &rate_specular}}) {
    const double value = object.get_number(name, 1);
    if (!(value >= 0 && value <= 1e6)) return located("a sampling rate lies between 0 and 1e6", object, name);
    *rate = std::max(kMinRate, static_cast<float>(value));
  }
  return {};
}

void PrincipledSurface::prepare(const SurfacePoint& at, bool below, Closure& out) const {
  PrincipledClosure p = {};
  const float metal = unit(metallic.eval(at));
  const float glass = unit(spec_trans.eval(at));
  p.transmission = (1 - metal) * glass;
  if (below && !(p.transmission > 0)) {
    out.set(p);
    out.black = true;
    return;
  }
  p.base = base_color.eval(at);
  p.eta = eta;
  p.roughness = unit(roughness.eval(at));
  std::tie(p.alpha_u, p.alpha_v) = ggx_alphas(p.roughness, unit(anisotropic.eval(at)));
  p.diffuse = (1 - metal) * (1 - glass);
  p.flatness = unit(flatness.eval(at));

  // The hue of a color is the color over its luminance; of black, white.
  const float light = luminance(p.base);
  const bool has_hue = light > 1e-20f;
  const float tint = (1 - metal) * unit(spec_tint.eval(at));
  const float r0 = (eta - 1) / (eta + 1) * ((eta - 1) / (eta + 1));
  p.f0_base = metal + (has_hue ? tint * r0 / light : 0);
  p.f0_white = has_hue ? 0 : tint * r0;
  p.f90 = metal + tint;
  p.f_dielectric = (1 - metal) - tint;
  const float cloth = (1 - metal) * unit(sheen.eval(at));
  const float cloth_tint = unit(sheen_tint.eval(at));
  p.sheen_base = has_hue ? cloth * cloth_tint / light : 0;
  p.sheen_white = cloth * (has_hue ? 1 - cloth_tint : 1);

  const float coat = unit(clearcoat.eval(at));
  p.coat = 0.25f * coat;
  p.coat_alpha = coat_alpha_of(unit(clearcoat_gloss.eval(at)));
  const float coat_alpha2 = p.coat_alpha * p.coat_alpha;
  p.coat_norm = (coat_alpha2 - 1) / (math::kPi * math::logf(coat_alpha2));
  p.rate_diffuse = rate_diffuse * p.diffuse;
  p.rate_coat = rate_coat * p.coat;
  p.rate_specular = rate_specular;
  out.set(p);
}

BsdfFacts PrincipledSurface::facts() const {
  const auto [along, across] = ggx_alphas(unit(roughness.minimum()), unit(anisotropic.maximum()));
  float least = std::min(along, across);
  if (clearcoat.maximum() > 0) least = std::min(least, coat_alpha_of(unit(clearcoat_gloss.maximum())));
  // The lobes are added: a rough bound of each.
  const float base = base_color.maximum().max_component();
  return {.smooth = true,
          .transmissive = spec_trans.maximum() > 0 && metallic.minimum() < 1,
          .max_albedo = std::max(1.0f, base) + unit(sheen.maximum()) + unit(clearcoat.maximum()),
          .min_roughness = std::min(1.0f, least)};
}

}  // namespace candela::scene
