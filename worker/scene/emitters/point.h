// A point that shines evenly in all directions.
#pragma once

#include <algorithm>
#include <cmath>
#include <string_view>

#include "common/base/result.h"
#include "common/description/object.h"
#include "worker/core/vec.h"
#include "worker/scene/emitters/cone.h"
#include "worker/scene/emitters/emitter.h"
#include "worker/scene/emitters/emitter_build.h"
#include "worker/scene/emitters/light_bounds.h"
#include "worker/scene/emitters/scene_extent.h"
#include "worker/scene/shapes/geometry.h"
#include "worker/scene/textures/texture.h"

namespace candela::scene {

class PointLight {
 public:
  static constexpr bool kInfinite = false;
  static constexpr bool kReadsRest = false;
  static constexpr bool kDelta = true;
  static constexpr std::string_view kPlugins[] = {"point"};

  static Result<PointLight> build(const description::Object& object, TextureStore& textures);

  PointLight(Vec3 position, Spectrum intensity)
      : position_(position), intensity_(intensity), strength_(luminance(intensity)) {}

  DirectOutcome sample_direct(const SurfaceHit& reference, Vec3 front, double rest, Vec2 u,
                              DirectSample& out) const;
  // No ray meets it.
  float pdf_direct_solid_angle(Vec3 /*reference*/, Vec3 /*d*/, const SurfaceHit& /*hit*/) const { return 0; }

  bool sample_emission(const SceneExtent& scene, double rest, Vec2 u_position, Vec2 u_direction,
                       EmissionSample& out) const;
  bool pdf_emission(const SceneExtent& scene, Vec3 ng, Vec3 d, EmissionDensity& out) const;

  Spectrum power(const SceneExtent& /*scene*/) const { return intensity_ * (4 * math::kPi); }
  LightBounds bounds(const Geometry& geometry) const;
  Spectrum intensity(Vec3 /*d*/) const { return intensity_; }
  Spectrum peak() const { return intensity_; }
  Vec3 position() const { return position_; }
  bool black() const { return intensity_.is_black(); }
  float max_radiance(double scene_radius) const { return radiance_of_point(intensity_, scene_radius); }
  float importance(Vec3 p, Vec3 front) const {
    const Vec3 v = position_ - p;
    const float d2 = std::max(length_squared(v), 1e-36f);
    if (is_zero(front)) return std::min(strength_ / d2, kMaxImportance);
    const float h = dot(front, v);
    if (!(h > 0)) return 0;
    return std::min(strength_ * std::max(h / std::sqrt(d2), kMinBoundCosine) / d2, kMaxImportance);
  }

 private:
  Vec3 position_;
  Spectrum intensity_;
  float strength_;
};

}  // namespace candela::scene
