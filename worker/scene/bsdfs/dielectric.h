// A smooth boundary between two dielectrics: delta reflection and refraction, chosen by Fresnel's reflectance
// times the lobes' colours. Refraction scales radiance by (n_o / n_i)^2, importance not [Veach 1997, ch. 5].
#pragma once

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/fresnel.h"

namespace candela::scene::dielectric {

inline bool sample(const DielectricParameters& p, Vec3 wo, float u_lobe, TransportMode mode,
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

}  // namespace candela::scene::dielectric
