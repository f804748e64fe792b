#include "worker/scene/bsdfs/dielectric.h"

#include <algorithm>
#include <cmath>

#include "worker/scene/bsdfs/fresnel.h"
#include "worker/scene/bsdfs/kinds.h"

namespace candela::scene {

bool sample(const DielectricClosure& p, Vec3 wo, float u_lobe, Vec2 /*u*/, TransportMode mode,
            BsdfSample& out) {
  if (wo.z == 0) return false;
  const bool outside = wo.z > 0;
  const float eta = outside ? p.eta : 1 / p.eta;  // far side over wo's side
  float cos_t = 0;
  const float fresnel = fresnel_dielectric(std::min(1.0f, std::abs(wo.z)),
                                           std::min(1.0f, wo.x * wo.x + wo.y * wo.y), eta, cos_t);
  const float r = fresnel * p.reflectance.max_component();
  const float t = (1 - fresnel) * p.transmittance.max_component();
  if (!(r + t > 0)) return false;
  const float prob_reflect = r / (r + t);
  out.delta = true;
  // Fresnel's reflectance is the same from both ends of either path.
  out.prob = out.prob_reverse = u_lobe < prob_reflect ? prob_reflect : 1 - prob_reflect;
  if (u_lobe < prob_reflect) {
    out.wi = {-wo.x, -wo.y, wo.z};
    out.weight = p.reflectance * (fresnel / prob_reflect);
    return true;
  }
  if (t == 0) return false;
  const float ratio = 1 / eta;
  out.wi = {-wo.x * ratio, -wo.y * ratio, outside ? -cos_t : cos_t};
  if (cos_t == 0) return false;  // exactly along the surface
  out.transmitted = true;
  out.eta = eta;
  const float scale = mode == TransportMode::radiance ? ratio * ratio : 1.0f;
  out.weight = p.transmittance * (scale * (1 - fresnel) / (1 - prob_reflect));
  return true;
}

Result<void> DielectricSurface::build(const description::Object& object, const BuildContext& context) {
  CANDELA_ASSIGN(reflectance, read_reflectance(object, context.textures, "specular_reflectance", 1));
  CANDELA_ASSIGN(transmittance, read_reflectance(object, context.textures, "specular_transmittance", 1));
  CANDELA_ASSIGN(eta, read_relative_eta(object, 1.5046, 1.000277));  // bk7 in air
  return {};
}

void DielectricSurface::prepare(const SurfacePoint& at, bool /*below*/, Closure& out) const {
  const DielectricClosure p = {reflectance.eval(at), transmittance.eval(at), eta};
  out.set(p);
  out.black = p.reflectance.is_black() && p.transmittance.is_black();
}

BsdfFacts DielectricSurface::facts() const {
  const float passing = transmittance.maximum().max_component();
  return {.delta = true,
          .transmissive = passing > 0,
          .max_albedo = std::max(reflectance.maximum().max_component(), passing),
          .min_roughness = 0};
}

}  // namespace candela::scene
