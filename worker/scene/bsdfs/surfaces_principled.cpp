#include "worker/scene/bsdfs/surfaces_principled.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "worker/core/math.h"
#include "worker/scene/bsdfs/surface_support.h"

namespace candela::scene {
namespace {

constexpr float kLeastGgxAlpha = 0.001f;  // Mitsuba's
constexpr float kLeastRate = 0.01f;       // no lobe is left to chance alone

float unit(float v) {
  return std::clamp(v, 0.0f, 1.0f);
}
float most_of(const FloatTexture& texture) {
  return texture.texture == nullptr ? texture.constant : luminance(texture.texture->maximum());
}

// Two roughnesses of the same product, their ratio up to 10 [Burley 2012, section 5.4].
std::pair<float, float> ggx_alphas(float roughness, float anisotropic) {
  const float alpha = roughness * roughness;
  const float aspect = std::sqrt(1 - 0.9f * anisotropic);
  return {std::max(kLeastGgxAlpha, alpha / aspect), std::max(kLeastGgxAlpha, alpha * aspect)};
}

float coat_alpha_of(float gloss) {
  return 0.1f + gloss * (0.001f - 0.1f);
}

}  // namespace

Result<void> PrincipledSurface::build(const description::Object& object, TextureStore& textures) {
  CANDELA_ASSIGN(base_color, read_reflectance(object, textures, "base_color", 0.5f));
  const auto read = [&](std::string_view name, float otherwise, FloatTexture& out) -> Result<void> {
    CANDELA_ASSIGN(out, textures.number(object, name, otherwise));
    if (out.is_constant() && !(out.constant >= 0 && out.constant <= 1))
      return located(std::string(name) + " lies between 0 and 1, not at " + shown(out.constant), object,
                     name);
    return {};
  };
  CANDELA_TRY(read("roughness", 0.5f, roughness));
  CANDELA_TRY(read("anisotropic", 0, anisotropic));
  CANDELA_TRY(read("metallic", 0, metallic));
  CANDELA_TRY(read("spec_trans", 0, spec_trans));
  CANDELA_TRY(read("spec_tint", 0, spec_tint));
  CANDELA_TRY(read("sheen", 0, sheen));
  CANDELA_TRY(read("sheen_tint", 0, sheen_tint));
  CANDELA_TRY(read("flatness", 0, flatness));
  CANDELA_TRY(read("clearcoat", 0, clearcoat));
  CANDELA_TRY(read("clearcoat_gloss", 0, clearcoat_gloss));
  const bool passes = most_of(spec_trans) > 0;
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
    *rate = std::max(kLeastRate, static_cast<float>(value));
  }
  return {};
}

void PrincipledSurface::prepare(Vec2 uv, bool below, Closure& out) const {
  out.kind = BsdfKind::principled;
  PrincipledParameters& p = out.principled = {};
  const float metal = unit(metallic.eval(uv));
  const float glass = unit(spec_trans.eval(uv));
  p.transmission = (1 - metal) * glass;
  out.black = below && !(p.transmission > 0);
  if (out.black) return;
  p.base = base_color.eval(uv);
  p.eta = eta;
  p.roughness = unit(roughness.eval(uv));
  std::tie(p.alpha_u, p.alpha_v) = ggx_alphas(p.roughness, unit(anisotropic.eval(uv)));
  p.diffuse = (1 - metal) * (1 - glass);
  p.flatness = unit(flatness.eval(uv));

  // The hue of a colour is the colour over its luminance; of black, white.
  const float light = luminance(p.base);
  const bool has_hue = light > 1e-20f;
  const float tint = (1 - metal) * unit(spec_tint.eval(uv));
  const float r0 = (eta - 1) / (eta + 1) * ((eta - 1) / (eta + 1));
  p.f0_base = metal + (has_hue ? tint * r0 / light : 0);
  p.f0_white = has_hue ? 0 : tint * r0;
  p.f90 = metal + tint;
  p.f_dielectric = (1 - metal) - tint;
  const float cloth = (1 - metal) * unit(sheen.eval(uv));
  const float cloth_tint = unit(sheen_tint.eval(uv));
  p.sheen_base = has_hue ? cloth * cloth_tint / light : 0;
  p.sheen_white = cloth * (has_hue ? 1 - cloth_tint : 1);

  const float coat = unit(clearcoat.eval(uv));
  p.coat = 0.25f * coat;
  p.coat_alpha = coat_alpha_of(unit(clearcoat_gloss.eval(uv)));
  const float coat_alpha2 = p.coat_alpha * p.coat_alpha;
  p.coat_norm = (coat_alpha2 - 1) / (math::kPi * math::logf(coat_alpha2));
  p.rate_diffuse = rate_diffuse * p.diffuse;
  p.rate_coat = rate_coat * p.coat;
  p.rate_specular = rate_specular;
}

BsdfFacts PrincipledSurface::facts() const {
  const auto [along, across] = ggx_alphas(unit(roughness.minimum()), unit(most_of(anisotropic)));
  float least = std::min(along, across);
  if (most_of(clearcoat) > 0) least = std::min(least, coat_alpha_of(unit(most_of(clearcoat_gloss))));
  // The lobes are added: a rough bound of each.
  const float base = base_color.maximum().max_component();
  return {.smooth = true,
          .transmissive = most_of(spec_trans) > 0 && metallic.minimum() < 1,
          .max_albedo = std::max(1.0f, base) + unit(most_of(sheen)) + unit(most_of(clearcoat)),
          .min_roughness = std::min(1.0f, least)};
}

}  // namespace candela::scene
