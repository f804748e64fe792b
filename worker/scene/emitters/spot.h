// Mitsuba's spot light: a point that shines into a cone, evenly up to beam_width from the axis and falling
// off linearly in the angle to nothing at cutoff_angle, times an optional texture projected along the axis.
#pragma once

#include <string_view>

#include "common/base/result.h"
#include "common/description/object.h"
#include "worker/core/vec.h"
#include "worker/scene/emitters/cone_importance.h"
#include "worker/scene/emitters/emitter.h"
#include "worker/scene/emitters/emitter_build.h"
#include "worker/scene/emitters/light_bounds.h"
#include "worker/scene/emitters/scene_extent.h"
#include "worker/scene/shapes/geometry.h"
#include "worker/scene/textures/texture.h"

namespace candela::scene {

class SpotLight {
 public:
  static constexpr bool kInfinite = false;
  static constexpr bool kReadsRest = false;
  static constexpr bool kDelta = true;
  static constexpr std::string_view kPlugins[] = {"spot"};

  static Result<SpotLight> build(const description::Object& object, TextureStore& textures);

  // frame.n is the axis, frame.s and frame.t span the texture; angles in radians, 0 <= beam <= cutoff <= pi,
  // cutoff > 0 (below pi / 2 with a texture that varies).
  SpotLight(Vec3 position, const Frame& frame, Spectrum intensity, double cutoff, double beam,
            const ColorTexture& texture);

  DirectOutcome sample_direct(const SurfaceHit& reference, Vec3 front, double rest, Vec2 u,
                              DirectSample& out) const;
  // No ray meets it.
  float pdf_direct_solid_angle(Vec3 /*reference*/, Vec3 /*d*/, const SurfaceHit& /*hit*/) const { return 0; }

  bool sample_emission(const SceneExtent& scene, double rest, Vec2 u_position, Vec2 u_direction,
                       EmissionSample& out) const;
  bool pdf_emission(const SceneExtent& scene, Vec3 ng, Vec3 d, EmissionDensity& out) const;

  // W; by quadrature where there is a texture, analytic otherwise.
  Spectrum power(const SceneExtent& /*scene*/) const { return power_; }
  LightBounds bounds(const Geometry& geometry) const;
  float importance(Vec3 p, Vec3 front) const {
    return cone_importance(strength_, position_ - p, front, frame_.n, cos_cutoff_);
  }

  Spectrum peak() const { return intensity_ * texture_.maximum(); }
  // W / sr towards d (unit, world).
  Spectrum intensity(Vec3 d) const;
  Vec3 position() const { return position_; }
  bool black() const { return !(luminance(peak()) > 0); }
  float max_radiance(double scene_radius) const { return radiance_of_point(peak(), scene_radius); }

 private:
  // Uniform in the cone, with its density.
  Vec3 sample(Vec2 u) const;
  float pdf_solid_angle(Vec3 d) const;
  float falloff(Vec3 local) const;

  Vec3 position_;
  Frame frame_;
  Spectrum intensity_;
  ColorTexture texture_;
  float strength_;       // importance at unit distance and cosines
  float cutoff_, beam_;  // radians
  float cos_cutoff_, inverse_transition_, inverse_tangent_;
  float one_minus_cos_;  // of the cutoff, without its cancellation
  Spectrum power_;
};

}  // namespace candela::scene
