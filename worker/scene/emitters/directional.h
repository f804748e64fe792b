// Parallel light from infinitely far away.
#pragma once

#include <algorithm>
#include <string_view>

#include "common/base/result.h"
#include "common/description/object.h"
#include "worker/core/vec.h"
#include "worker/scene/emitters/cone.h"
#include "worker/scene/emitters/emitter.h"
#include "worker/scene/emitters/emitter_build.h"
#include "worker/scene/emitters/light_bounds.h"
#include "worker/scene/emitters/scene_extent.h"
#include "worker/scene/textures/texture.h"

namespace candela::scene {

class DirectionalLight {
 public:
  static constexpr bool kInfinite = true;
  static constexpr bool kReadsRest = false;
  static constexpr bool kDelta = true;
  static constexpr std::string_view kPlugins[] = {"directional"};

  static Result<DirectionalLight> build(const description::Object& object, TextureStore& textures);

  // direction: unit, the way the light travels; irradiance on a surface facing it.
  DirectionalLight(Vec3 direction, Spectrum irradiance)
      : direction_(direction), irradiance_(irradiance), strength_(luminance(irradiance)) {}

  DirectOutcome sample_direct(const SurfaceHit& reference, Vec3 front, double rest, Vec2 u,
                              DirectSample& out) const;
  // No ray meets it.
  float pdf_direct_solid_angle(Vec3 /*reference*/, Vec3 /*d*/, const SurfaceHit& /*hit*/) const { return 0; }

  bool sample_emission(const SceneExtent& scene, double rest, Vec2 u_position, Vec2 u_direction,
                       EmissionSample& out) const;
  bool pdf_emission(const SceneExtent& scene, Vec3 ng, Vec3 d, EmissionDensity& out) const;

  Spectrum power(const SceneExtent& scene) const {
    return irradiance_ * static_cast<float>(scene.disk_area());
  }
  bool black() const { return irradiance_.is_black(); }
  float max_radiance(double /*scene_radius*/) const { return luminance(irradiance_); }
  float importance(Vec3 /*p*/, Vec3 front) const {
    if (is_zero(front)) return strength_;
    const float cosine = -dot(front, direction_);
    return cosine > 0 ? strength_ * std::max(cosine, kMinBoundCosine) : 0.0f;
  }

 private:
  Vec3 direction_;
  Spectrum irradiance_;
  float strength_;
};

}  // namespace candela::scene
