#include "worker/scene/bsdfs/surfaces_phong.h"

#include <algorithm>
#include <cmath>

#include "worker/scene/bsdfs/surface_support.h"

namespace candela::scene {
namespace {

constexpr float kMostExponent = 1e6f;  // beyond, the lobe is narrower than float directions resolve

float clamped_exponent(float exponent) {
  return std::clamp(exponent, 0.0f, kMostExponent);
}

}  // namespace

Result<void> TwoColours::build(const description::Object& object, TextureStore& textures) {
  CANDELA_ASSIGN(diffuse, read_reflectance(object, textures, "diffuse_reflectance", 0.5f));
  CANDELA_ASSIGN(specular, read_reflectance(object, textures, "specular_reflectance", 0.2f));
  const float most = (diffuse.maximum() + specular.maximum()).max_component();
  if (most > 1) scale = 0.99f / most;
  return {};
}

float TwoColours::prepare(Vec2 uv, Spectrum& diffuse_here, Spectrum& specular_here) const {
  diffuse_here = diffuse.eval(uv) * scale;
  specular_here = specular.eval(uv) * scale;
  const float d = luminance(diffuse_here);
  const float s = luminance(specular_here);
  return s > 0 ? s / (d + s) : 0.0f;
}

float TwoColours::max_albedo() const {
  return scale * (diffuse.maximum() + specular.maximum()).max_component();
}

Result<void> PhongSurface::build(const description::Object& object, TextureStore& textures) {
  CANDELA_TRY(colours.build(object, textures));
  CANDELA_ASSIGN(exponent, textures.number(object, "exponent", 30));
  if (exponent.minimum() < 0) return located("the exponent is not negative", object, "exponent");
  return {};
}

void PhongSurface::prepare(Vec2 uv, bool below, Closure& out) const {
  out.kind = BsdfKind::phong;
  out.phong = {};
  out.black = below;
  if (below) return;
  out.phong.prob_specular = colours.prepare(uv, out.phong.diffuse, out.phong.specular);
  out.phong.exponent = clamped_exponent(exponent.eval(uv));
  out.black = out.phong.diffuse.is_black() && out.phong.specular.is_black();
}

BsdfFacts PhongSurface::facts() const {
  const float most = exponent.texture == nullptr ? exponent.constant : luminance(exponent.texture->maximum());
  // The Beckmann roughness of a lobe as wide.
  return {.smooth = true,
          .max_albedo = colours.max_albedo(),
          .min_roughness = std::min(1.0f, std::sqrt(2 / (clamped_exponent(most) + 2)))};
}

Result<void> WardSurface::build(const description::Object& object, TextureStore& textures) {
  CANDELA_TRY(colours.build(object, textures));
  // alpha is what the other two are by default.
  const auto alpha = static_cast<float>(object.get_number("alpha", 0.1));
  CANDELA_ASSIGN(alpha_u, textures.number(object, "alpha_u", alpha));
  CANDELA_ASSIGN(alpha_v, textures.number(object, "alpha_v", alpha));
  for (const auto& [name, value] : {std::pair{"alpha_u", &alpha_u}, std::pair{"alpha_v", &alpha_v}}) {
    if (!(value->minimum() >= 0)) return located("roughness is not negative", object, name);
  }
  const std::string name = object.get_string("variant", "balanced");
  if (name == "ward") {
    variant = WardVariant::ward;
  } else if (name == "ward-duer") {
    variant = WardVariant::ward_duer;
  } else if (name != "balanced") {
    return located("unknown variant '" + name + "'; known: ward, ward-duer, balanced", object, "variant");
  }
  return {};
}

void WardSurface::prepare(Vec2 uv, bool below, Closure& out) const {
  out.kind = BsdfKind::ward;
  out.ward = {};
  out.black = below;
  if (below) return;
  WardParameters& p = out.ward;
  p.prob_specular = colours.prepare(uv, p.diffuse, p.specular);
  // Above 10 nothing changes but that the density underflows.
  p.alpha_u = std::clamp(alpha_u.eval(uv), kLeastAlpha, 10.0f);
  p.alpha_v = std::clamp(alpha_v.eval(uv), kLeastAlpha, 10.0f);
  p.variant = variant;
  out.black = p.diffuse.is_black() && p.specular.is_black();
}

BsdfFacts WardSurface::facts() const {
  return {.smooth = true,
          .max_albedo = colours.max_albedo(),
          .min_roughness = std::clamp(std::min(alpha_u.minimum(), alpha_v.minimum()), kLeastAlpha, 1.0f)};
}

}  // namespace candela::scene
