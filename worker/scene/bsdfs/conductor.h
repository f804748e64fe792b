// A smooth metal: mirror reflection with complex Fresnel reflectance. One delta lobe, one-sided.
#pragma once

#include "worker/scene/bsdf.h"
#include "worker/scene/bsdfs/fresnel.h"

namespace candela::scene::conductor {

inline bool sample(const ConductorParameters& p, Vec3 wo, BsdfSample& out) {
  if (wo.z <= 0) return false;
  out.wi = {-wo.x, -wo.y, wo.z};
  out.weight = p.reflectance * fresnel_conductor(std::min(1.0f, wo.z), p.eta, p.k);
  out.delta = true;
  return true;
}

}  // namespace candela::scene::conductor
