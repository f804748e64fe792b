// The colors of Mitsuba 0.6's phenomenological bsdfs, phong and ward.
#pragma once

#include "worker/scene/bsdfs/surface.h"

namespace candela::scene {

// A diffuse and a specular color. Where their largest values add up to more than 1, both are scaled down for
// the whole surface, as 0.6 does to conserve energy.
struct TwoColors {
  ColorTexture diffuse, specular;
  float scale = 1;
  Result<void> build(const description::Object& object, const BuildContext& context);
  // Returns the probability of sampling the specular one.
  float prepare(const SurfacePoint& at, Spectrum& diffuse_here, Spectrum& specular_here) const;
  float max_albedo() const;
};

}  // namespace candela::scene
