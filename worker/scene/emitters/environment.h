// Light from infinitely far away: `constant` (one radiance), `envmap` (a latitude-longitude image), and the
// sky and the sun, which become such an image.
//
// Orientation is Mitsuba 3's: in the emitter's space u = atan2(x, -z) / 2 pi, v = acos(y) / pi, v = 0 the top
// row. Lookups are bilinear between texel centers horizontally (periodic); rows span the sphere from pole to
// pole, so that the first row's values lie at the pole.
#pragma once

#include <memory>
#include <string_view>

#include "common/base/result.h"
#include "common/description/object.h"
#include "worker/core/math.h"
#include "worker/core/vec.h"
#include "worker/scene/emitters/emitter.h"
#include "worker/scene/emitters/emitter_build.h"
#include "worker/scene/emitters/scene_extent.h"
#include "worker/scene/textures/texture.h"

namespace candela::scene {

class Environment {
 public:
  static constexpr bool kInfinite = true;
  static constexpr bool kReadsRest = false;
  static constexpr bool kDelta = false;
  static constexpr std::string_view kPlugins[] = {"constant", "envmap", "sky", "sun", "sunsky"};

  static Result<Environment> build(const description::Object& object, TextureStore& textures);
  static Environment constant(Spectrum radiance);

  // Seen looking along d (unit, world), i.e. arriving along -d.
  Spectrum radiance(Vec3 d) const;

  // A direction d towards the environment with its density; false where the environment is black.
  bool sample(Vec2 u, Vec3& d, float& pdf_solid_angle) const;
  // The density with which sample() chooses d; exactly that of the quantised tables it samples by.
  float pdf_solid_angle(Vec3 d) const;

  // The direction, with its density and this environment's own light. The shadow ray is filled even where it
  // is dark, since another environment may shine along it.
  DirectOutcome sample_direct(const SurfaceHit& reference, Vec3 front, double rest, Vec2 u,
                              DirectSample& out) const;
  // Its density. Where the reference has a front, a constant environment is sampled by the cosine.
  float pdf_direct_solid_angle(Vec3 front, Vec3 d) const;
  float pdf_direct_solid_angle(Vec3 /*reference*/, Vec3 d, const SurfaceHit& /*hit*/) const {
    return pdf_solid_angle(d);
  }

  bool sample_emission(const SceneExtent& scene, double rest, Vec2 u_position, Vec2 u_direction,
                       EmissionSample& out) const;
  // d: along which the light travels.
  bool pdf_emission(const SceneExtent& scene, Vec3 ng, Vec3 d, EmissionDensity& out) const;

  Spectrum power(const SceneExtent& scene) const {
    return mean_radiance_ * (4 * math::kPi) * static_cast<float>(scene.disk_area());
  }
  float importance(Vec3 /*p*/, Vec3 /*front*/) const { return luminance(mean_radiance_) * math::kPi; }

  bool is_constant() const { return map_ == nullptr; }
  bool black() const { return mean_radiance_.is_black(); }
  // Mean over the sphere of directions: the power onto a disk of radius r is mean * 4 pi * pi r^2.
  Spectrum mean_radiance() const { return mean_radiance_; }
  float max_radiance(double /*scene_radius*/) const { return max_luminance_; }
  // The relative variance of what a sample of a scattering direction finds of it, roughly: that of the
  // radiance over directions, and something for what stands before it.
  float variation() const { return variation_; }

 private:
  static constexpr float kVariationOfShadows = 0.03f;

  struct Map;
  Spectrum mean_radiance_;
  float max_luminance_ = 0;
  float variation_ = kVariationOfShadows;
  std::shared_ptr<const Map> map_;  // null: constant
};

}  // namespace candela::scene
