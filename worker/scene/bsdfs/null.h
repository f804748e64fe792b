// No surface at all: light passes straight on. Bounds media.
#pragma once

#include "worker/scene/bsdf.h"

namespace candela::scene::null {

inline bool sample(Vec3 wo, BsdfSample& out) {
  out.wi = -wo;
  out.weight = Spectrum(1);
  out.delta = true;
  out.transmitted = true;
  out.straight = true;
  return true;
}

}  // namespace candela::scene::null
