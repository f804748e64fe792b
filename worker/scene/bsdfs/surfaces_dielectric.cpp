#include "worker/scene/bsdfs/surfaces_dielectric.h"

#include <algorithm>
#include <cmath>

#include "worker/scene/bsdfs/surface_support.h"

namespace candela::scene {

bool RoughDielectricSurface::matched() const {
  return std::abs(boundary.eta - 1) < kMatchedIndex;
}

Result<void> RoughDielectricSurface::build(const description::Object& object, TextureStore& textures) {
  CANDELA_TRY(boundary.build(object, textures));
  CANDELA_ASSIGN(const RoughnessParameters roughness, read_roughness(object, textures));
  alpha_u = roughness.alpha_u;
  alpha_v = roughness.alpha_v;
  ggx = roughness.ggx;
  sample_visible = roughness.sample_visible;
  return {};
}

void RoughDielectricSurface::prepare(Vec2 uv, bool /*below*/, Closure& out) const {
  const Spectrum reflectance = boundary.reflectance.eval(uv);
  const Spectrum transmittance = boundary.transmittance.eval(uv);
  if (matched()) {
    out.kind = BsdfKind::thindielectric;
    out.dielectric = {reflectance, transmittance, 1};
    out.black = transmittance.is_black();
    return;
  }
  out.kind = BsdfKind::roughdielectric;
  out.rough_dielectric = {reflectance,
                          transmittance,
                          boundary.eta,
                          std::max(kLeastAlpha, alpha_u.eval(uv)),
                          std::max(kLeastAlpha, alpha_v.eval(uv)),
                          ggx,
                          sample_visible};
  out.black = reflectance.is_black() && transmittance.is_black();
}

BsdfFacts RoughDielectricSurface::facts() const {
  const float passing = boundary.transmittance.maximum().max_component();
  if (matched()) return {.straight = passing > 0, .max_albedo = passing};
  return {.smooth = true,
          .transmissive = passing > 0,
          .max_albedo = std::max(boundary.reflectance.maximum().max_component(), passing),
          .min_roughness = std::max(kLeastAlpha, std::min(alpha_u.minimum(), alpha_v.minimum()))};
}

Result<void> ThinDielectricSurface::build(const description::Object& object, TextureStore& textures) {
  return boundary.build(object, textures);
}

void ThinDielectricSurface::prepare(Vec2 uv, bool below, Closure& out) const {
  boundary.prepare(uv, below, out);
  out.kind = BsdfKind::thindielectric;
}

BsdfFacts ThinDielectricSurface::facts() const {
  BsdfFacts facts = boundary.facts();
  facts.straight = facts.transmissive;
  facts.transmissive = false;
  // An index of 1 reflects nothing.
  facts.delta = boundary.eta != 1 && !boundary.reflectance.maximum().is_black();
  if (!facts.delta) facts.min_roughness = 1;
  return facts;
}

}  // namespace candela::scene
