// The densities of pbrt's medium 'cloud': octaves of gradient noise that fall off with height.
#pragma once

#include "worker/core/vec.h"

namespace candela::loaders {

struct PbrtCloud {
  float density = 1, wispiness = 1, frequency = 5;

  // In the medium's space, where y is the height, 0 to 1; the density is within 0 and 1.
  float at(Vec3 p) const;
};

// Perlin's gradient noise [Perlin 2002], between -1 and 1; 0 where all coordinates are whole.
float gradient_noise(Vec3 p);

}  // namespace candela::loaders
