// Light from infinitely far away: `constant` (one radiance) and `envmap` (a latitude-longitude image).
//
// Orientation is Mitsuba 3's: in the emitter's space u = atan2(x, -z) / 2 pi, v = acos(y) / pi, v = 0 the top
// row. Lookups are bilinear between texel centres horizontally (periodic); rows span the sphere from pole to
// pole, so that the first row's values lie at the pole.
#pragma once

#include <memory>
#include <vector>

#include "common/base/result.h"
#include "common/description/object.h"
#include "worker/core/vec.h"
#include "worker/scene/textures/texture.h"

namespace candela::scene {

class Environment {
 public:
  // From a description object "constant" or "envmap".
  static Result<Environment> build(const description::Object& object, TextureStore& textures);
  static Environment constant(Spectrum radiance);

  // Seen looking along d (unit, world), i.e. arriving along -d.
  Spectrum radiance(Vec3 d) const;

  // A direction d towards the environment with its density; false where the environment is black.
  bool sample(Vec2 u, Vec3& d, Spectrum& radiance, float& pdf_solid_angle) const;
  // The density with which sample() chooses d; exactly that of the quantised tables it samples by.
  float pdf_solid_angle(Vec3 d) const;

  bool is_constant() const { return map_ == nullptr; }
  bool black() const { return mean_radiance_.is_black(); }
  // Mean over the sphere of directions: the power onto a disk of radius r is mean * 4 pi * pi r^2.
  Spectrum mean_radiance() const { return mean_radiance_; }
  float max_luminance() const { return max_luminance_; }

 private:
  struct Map;
  Spectrum mean_radiance_;
  float max_luminance_ = 0;
  std::shared_ptr<const Map> map_;  // null: constant
};

}  // namespace candela::scene
