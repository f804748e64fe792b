// The bsdfs without microfacets beside them: diffuse, dielectric, conductors, null.
#include "worker/scene/bsdfs/surfaces.h"

#include <algorithm>
#include <utility>

#include "worker/scene/bsdfs/surface_support.h"

namespace candela::scene {

void BsdfFacts::forget_lobes() {
  delta = smooth = transmissive = straight = false;
  max_albedo = 0;
  min_roughness = 1;
}

void BsdfFacts::join(const BsdfFacts& other) {
  delta |= other.delta;
  smooth |= other.smooth;
  transmissive |= other.transmissive;
  straight |= other.straight;
  two_sided |= other.two_sided;
  perturbs |= other.perturbs;
  reads_partials |= other.reads_partials;
  max_albedo = std::max(max_albedo, other.max_albedo);
  min_roughness = std::min(min_roughness, other.min_roughness);
}

Result<void> DiffuseSurface::build(const description::Object& object, TextureStore& textures) {
  CANDELA_ASSIGN(reflectance, read_reflectance(object, textures, "reflectance", 0.5f));
  return {};
}

void DiffuseSurface::prepare(Vec2 uv, bool below, Closure& out) const {
  out.kind = BsdfKind::diffuse;
  if (below) {
    out.black = true;
    return;
  }
  out.diffuse = {reflectance.eval(uv)};
  out.black = out.diffuse.reflectance.is_black();
}

BsdfFacts DiffuseSurface::facts() const {
  return {.smooth = true, .max_albedo = reflectance.maximum().max_component()};
}

Result<void> DielectricSurface::build(const description::Object& object, TextureStore& textures) {
  CANDELA_ASSIGN(reflectance, read_reflectance(object, textures, "specular_reflectance", 1));
  CANDELA_ASSIGN(transmittance, read_reflectance(object, textures, "specular_transmittance", 1));
  CANDELA_ASSIGN(eta, read_relative_eta(object, 1.5046, 1.000277));  // bk7 in air
  return {};
}

void DielectricSurface::prepare(Vec2 uv, bool /*below*/, Closure& out) const {
  out.kind = BsdfKind::dielectric;
  out.dielectric = {reflectance.eval(uv), transmittance.eval(uv), eta};
  out.black = out.dielectric.reflectance.is_black() && out.dielectric.transmittance.is_black();
}

BsdfFacts DielectricSurface::facts() const {
  const float passing = transmittance.maximum().max_component();
  return {.delta = true,
          .transmissive = passing > 0,
          .max_albedo = std::max(reflectance.maximum().max_component(), passing),
          .min_roughness = 0};
}

Result<void> ConductorSurface::build(const description::Object& object, TextureStore& textures) {
  CANDELA_ASSIGN(reflectance, read_reflectance(object, textures, "specular_reflectance", 1));
  // Without eta and k: a mirror that reflects all.
  CANDELA_ASSIGN(eta, textures.color(object, "eta", Spectrum(0)));
  CANDELA_ASSIGN(k, textures.color(object, "k", Spectrum(1)));
  for (const auto& [name, value] : {std::pair{"eta", eta}, std::pair{"k", k}}) {
    if (value.maximum().max_component() > 1e6f)
      return located("values up to 1e6 are supported", object, name);
  }
  return {};
}

void ConductorSurface::prepare(Vec2 uv, bool below, Closure& out) const {
  out.kind = BsdfKind::conductor;
  if (below) {
    out.black = true;
    return;
  }
  out.conductor = {reflectance.eval(uv), eta.eval(uv), k.eval(uv)};
  out.black = out.conductor.reflectance.is_black();
}

BsdfFacts ConductorSurface::facts() const {
  return {.delta = true, .max_albedo = reflectance.maximum().max_component(), .min_roughness = 0};
}

Result<void> RoughConductorSurface::build(const description::Object& object, TextureStore& textures) {
  CANDELA_TRY(metal.build(object, textures));
  CANDELA_ASSIGN(const RoughnessParameters roughness, read_roughness(object, textures));
  alpha_u = roughness.alpha_u;
  alpha_v = roughness.alpha_v;
  ggx = roughness.ggx;
  sample_visible = roughness.sample_visible;
  return {};
}

void RoughConductorSurface::prepare(Vec2 uv, bool below, Closure& out) const {
  out.kind = BsdfKind::roughconductor;
  if (below) {
    out.black = true;
    return;
  }
  out.rough_conductor = {metal.reflectance.eval(uv),
                         metal.eta.eval(uv),
                         metal.k.eval(uv),
                         std::max(kLeastAlpha, alpha_u.eval(uv)),
                         std::max(kLeastAlpha, alpha_v.eval(uv)),
                         ggx,
                         sample_visible};
  out.black = out.rough_conductor.reflectance.is_black();
}

BsdfFacts RoughConductorSurface::facts() const {
  return {.smooth = true,
          .max_albedo = metal.reflectance.maximum().max_component(),
          .min_roughness = std::max(kLeastAlpha, std::min(alpha_u.minimum(), alpha_v.minimum()))};
}

Result<void> NullSurface::build(const description::Object& /*object*/, TextureStore& /*textures*/) {
  return {};
}

void NullSurface::prepare(Vec2 /*uv*/, bool /*below*/, Closure& out) const {
  out.kind = BsdfKind::null;
}

BsdfFacts NullSurface::facts() const {
  return {.straight = true, .max_albedo = 1};
}

}  // namespace candela::scene
