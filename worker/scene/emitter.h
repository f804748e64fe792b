// Emitters as the transport layer sees them.
#pragma once

#include <cstdint>

#include "worker/core/vec.h"
#include "worker/scene/hit.h"

namespace candela::scene {

// A direction towards light chosen at a reference point.
struct DirectSample {
  Vec3 wi;            // unit, world, from the reference point
  Spectrum radiance;  // arriving along -wi, unoccluded. Delta emitters: radiance * solid angle in the limit
                      // (intensity / r^2, irradiance)
  float pdf_solid_angle =
      0;  // including the choice of emitter; for delta emitters the discrete probability of that choice
  bool delta = false;
  std::uint32_t emitter = kNone;
  Ray shadow_ray;  // from the offset reference point, ends just before the light
};

}  // namespace candela::scene
