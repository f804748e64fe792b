#include "worker/scene/bsdfs/conductor.h"

#include <algorithm>
#include <utility>

#include "worker/scene/bsdfs/fresnel.h"
#include "worker/scene/bsdfs/kinds.h"

namespace candela::scene {

bool sample(const ConductorClosure& p, Vec3 wo, float /*u_lobe*/, Vec2 /*u*/, TransportMode /*mode*/,
            BsdfSample& out) {
  if (wo.z <= 0) return false;
  out.wi = {-wo.x, -wo.y, wo.z};
  out.weight = p.reflectance * fresnel_conductor(std::min(1.0f, wo.z), p.eta, p.k);
  out.delta = true;
  return true;
}

Result<void> ConductorSurface::build(const description::Object& object, const BuildContext& context) {
  CANDELA_ASSIGN(reflectance, read_reflectance(object, context.textures, "specular_reflectance", 1));
  // Without eta and k: a mirror that reflects all.
  CANDELA_ASSIGN(eta, context.textures.color(object, "eta", Spectrum(0)));
  CANDELA_ASSIGN(k, context.textures.color(object, "k", Spectrum(1)));
  for (const auto& [name, value] : {std::pair{"eta", eta}, std::pair{"k", k}}) {
    if (value.maximum().max_component() > 1e6f)
      return located("values up to 1e6 are supported", object, name);
  }
  return {};
}

void ConductorSurface::prepare(const SurfacePoint& at, bool below, Closure& out) const {
  ConductorClosure p = {};
  if (!below) p = {reflectance.eval(at), eta.eval(at), k.eval(at)};
  out.set(p);
  out.black = p.reflectance.is_black();
}

BsdfFacts ConductorSurface::facts() const {
  return {.delta = true, .max_albedo = reflectance.maximum().max_component(), .min_roughness = 0};
}

}  // namespace candela::scene
