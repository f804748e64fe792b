// A diffuse base under a dielectric coat, for all plastics.
#pragma once

#include "worker/scene/bsdfs/surface.h"

namespace candela::scene {

struct CoatedBase {
  ColorTexture diffuse, specular;
  float eta = 1;
  bool nonlinear = false;
  double internal_reflectance = 0;  // of the coat, for diffuse light from inside
  Result<void> build(const description::Object& object, const BuildContext& context);
  // `base` is what is left of `diffuse` after any number of reflections inside, over eta^2; `specular_share`
  // is the specular part's share of the two colors. False: both are black.
  bool prepare(const SurfacePoint& at, Spectrum& base, Spectrum& coat, float& specular_share) const {
    return prepare(at, internal_reflectance, base, coat, specular_share);
  }
  // For a coat whose internal reflectance varies.
  bool prepare(const SurfacePoint& at, double internal_reflectance_here, Spectrum& base, Spectrum& coat,
               float& specular_share) const;
  float max_albedo() const;
};

}  // namespace candela::scene
