#include "worker/scene/bsdfs/surfaces_plastic.h"

#include <algorithm>

#include "worker/scene/bsdfs/surface_support.h"

namespace candela::scene {

Result<void> CoatedBase::build(const description::Object& object, TextureStore& textures) {
  CANDELA_ASSIGN(diffuse, read_reflectance(object, textures, "diffuse_reflectance", 0.5f));
  CANDELA_ASSIGN(specular, read_reflectance(object, textures, "specular_reflectance", 1));
  CANDELA_ASSIGN(eta, read_relative_eta(object, 1.49, 1.000277));  // polypropylene in air
  nonlinear = object.get_bool("nonlinear", false);
  return {};
}

bool CoatedBase::prepare(Vec2 uv, Spectrum& base, Spectrum& coat, float& specular_share) const {
  const Spectrum d = diffuse.eval(uv);
  coat = specular.eval(uv);
  const float d_sum = d.r + d.g + d.b;
  const float s_sum = coat.r + coat.g + coat.b;
  if (!(d_sum + s_sum > 0)) return false;
  specular_share = s_sum / (d_sum + s_sum);
  // In double: with a high index nearly all is reflected inside, and eta^2 makes up for it.
  const auto left = [&](float rho) {
    const double lost = 1 - (nonlinear ? static_cast<double>(rho) : 1.0) * internal_reflectance;
    return static_cast<float>(static_cast<double>(rho) / (lost * static_cast<double>(eta) * eta));
  };
  base = {left(d.r), left(d.g), left(d.b)};
  return true;
}

float CoatedBase::max_albedo() const {
  return std::max(diffuse.maximum().max_component(), specular.maximum().max_component());
}

Result<void> PlasticSurface::build(const description::Object& object, TextureStore& textures) {
  CANDELA_TRY(base.build(object, textures));
  base.internal_reflectance = fresnel_diffuse_reflectance(1 / static_cast<double>(base.eta));
  return {};
}

void PlasticSurface::prepare(Vec2 uv, bool below, Closure& out) const {
  out.kind = BsdfKind::plastic;
  auto& p = out.plastic;
  out.black = below || !base.prepare(uv, p.diffuse, p.specular, p.specular_share);
  p.eta = base.eta;
}

BsdfFacts PlasticSurface::facts() const {
  const bool shines = base.eta != 1 && !base.specular.maximum().is_black();
  return {.delta = shines,
          .smooth = !base.diffuse.maximum().is_black(),
          .max_albedo = base.max_albedo(),
          .min_roughness = shines ? 0.0f : 1.0f};
}

Result<void> RoughPlasticSurface::build(const description::Object& object, TextureStore& textures,
                                        RoughTransmittances& coats) {
  CANDELA_TRY(base.build(object, textures));
  CANDELA_ASSIGN(const RoughnessParameters roughness, read_roughness(object, textures));
  if (!roughness.alpha_u.is_constant())
    return located("the roughness of roughplastic is one number for the whole surface", object, "alpha");
  alpha = std::max(kLeastAlpha, roughness.alpha_u.constant);
  ggx = roughness.ggx;
  sample_visible = roughness.sample_visible;
  coat = coats.get(ggx, alpha, base.eta);
  base.internal_reflectance = coat->internal_reflectance();
  return {};
}

void RoughPlasticSurface::prepare(Vec2 uv, bool below, Closure& out) const {
  out.kind = BsdfKind::roughplastic;
  auto& p = out.rough_plastic;
  out.black = below || !base.prepare(uv, p.diffuse, p.specular, p.specular_share);
  p.eta = base.eta;
  p.alpha = alpha;
  p.ggx = ggx;
  p.sample_visible = sample_visible;
  p.coat = coat.get();
}

BsdfFacts RoughPlasticSurface::facts() const {
  return {.smooth = true,
          .max_albedo = base.max_albedo(),
          .min_roughness = base.specular.maximum().is_black() ? 1.0f : alpha};
}

}  // namespace candela::scene
