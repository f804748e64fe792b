// Mitsuba 3's projector: a point that shines through a picture on the plane at distance 1 before it, such
// that the picture is the plane's irradiance over pi. With c the cosine to the axis the intensity is
//   I(d) = pi E(u, v) / c^3
// pbrt's projection light, as the other reading of the picture, has the intensity I(d) = E(u, v).
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

class ProjectorLight {
 public:
  static constexpr bool kInfinite = false;
  static constexpr bool kReadsRest = false;
  static constexpr bool kDelta = true;
  static constexpr std::string_view kPlugins[] = {"projector"};

  static Result<ProjectorLight> build(const description::Object& object, TextureStore& textures);

  // frame.n is the axis, frame.s points to the left of the picture and frame.t to its top; tan_x, tan_y > 0:
  // half its width and height.
  enum class Quantity { irradiance, intensity };  // of the picture
  ProjectorLight(Vec3 position, const Frame& frame, const ColorTexture& picture, Quantity quantity,
                 double scale, double tan_x, double tan_y);

  DirectOutcome sample_direct(const SurfaceHit& reference, Vec3 front, double rest, Vec2 u,
                              DirectSample& out) const;
  // No ray meets it.
  float pdf_direct_solid_angle(Vec3 /*reference*/, Vec3 /*d*/, const SurfaceHit& /*hit*/) const { return 0; }

  // Uniformly over the picture.
  bool sample_emission(const SceneExtent& scene, double rest, Vec2 u_position, Vec2 u_direction,
                       EmissionSample& out) const;
  bool pdf_emission(const SceneExtent& scene, Vec3 ng, Vec3 d, EmissionDensity& out) const;

  // W; by quadrature where the picture varies, analytic otherwise.
  Spectrum power(const SceneExtent& /*scene*/) const { return power_; }
  LightBounds bounds(const Geometry& geometry) const;
  float importance(Vec3 p, Vec3 front) const {
    return cone_importance(strength_, position_ - p, front, frame_.n, cos_corner_);
  }

  // W / sr, in no direction more.
  Spectrum peak() const;
  // W / sr towards d (unit, world).
  Spectrum intensity(Vec3 d) const;
  Vec3 position() const { return position_; }
  bool black() const { return !(luminance(peak()) > 0); }
  float max_radiance(double scene_radius) const { return radiance_of_point(peak(), scene_radius); }
  // The power by a quadrature of steps x steps places in the picture.
  Spectrum power_by(int steps) const;

 private:
  // False: d (unit, world) leaves beside the picture.
  bool picture_place(Vec3 d, Vec2& uv, float& cosine) const;
  float pdf_solid_angle(Vec3 d) const;

  Vec3 position_;
  Frame frame_;
  ColorTexture picture_;
  Quantity quantity_;
  float factor_;  // the scale, of irradiance times pi
  float tan_x_, tan_y_;
  float cos_corner_;
  float strength_;  // importance at unit distance and cosines
  Spectrum power_;
};

}  // namespace candela::scene
