// pbrt's goniometric light: a point whose intensity follows a square picture of the sphere of directions that
// keeps areas (equal_area.h). The picture is constant within each pixel, so that light that leaves has
// exactly the density of its intensity:
//   I(d) = I v(d),   p(d) = v(d) / (4 pi mean(v))
#pragma once

#include <cstdint>
#include <memory>
#include <string_view>

#include "common/base/result.h"
#include "common/description/object.h"
#include "worker/core/vec.h"
#include "worker/scene/emitters/emitter.h"
#include "worker/scene/emitters/emitter_build.h"
#include "worker/scene/emitters/light_bounds.h"
#include "worker/scene/emitters/scene_extent.h"
#include "worker/scene/shapes/geometry.h"
#include "worker/scene/textures/texel_image.h"
#include "worker/scene/textures/texture.h"

namespace candela::scene {

// A square picture of all directions, and how to choose one of them by its values.
class DirectionPicture {
 public:
  static constexpr std::uint32_t kMaxSide = 2048;

  // The mean of red, green and blue. The image is square, of at most kMaxSide pixels a side; its values are
  // finite and not negative.
  explicit DirectionPicture(const TexelImage& image);
  ~DirectionPicture();
  DirectionPicture(const DirectionPicture&) = delete;
  DirectionPicture& operator=(const DirectionPicture&) = delete;

  // The value of a direction in the picture's space: +z is in its middle.
  float value(Vec3 local) const;
  // A direction in the picture's space with a density of its value; the mean must be above zero.
  Vec3 sample(Vec2 u) const;
  float pdf_solid_angle(Vec3 local) const;

  double mean() const { return mean_; }
  float maximum() const { return maximum_; }

 private:
  struct Tables;
  double mean_ = 0;
  float maximum_ = 0;
  std::unique_ptr<const Tables> tables_;
};

class GoniometricLight {
 public:
  static constexpr bool kInfinite = false;
  static constexpr bool kReadsRest = false;
  static constexpr bool kDelta = true;
  static constexpr std::string_view kPlugins[] = {"goniometric"};

  static Result<GoniometricLight> build(const description::Object& object, TextureStore& textures);

  // The picture's space is the frame's. The picture is not black.
  GoniometricLight(Vec3 position, const Frame& frame, Spectrum intensity,
                   std::shared_ptr<const DirectionPicture> picture);

  DirectOutcome sample_direct(const SurfaceHit& reference, Vec3 front, double rest, Vec2 u,
                              DirectSample& out) const;
  // No ray meets it.
  float pdf_direct_solid_angle(Vec3 /*reference*/, Vec3 /*d*/, const SurfaceHit& /*hit*/) const { return 0; }

  bool sample_emission(const SceneExtent& scene, double rest, Vec2 u_position, Vec2 u_direction,
                       EmissionSample& out) const;
  bool pdf_emission(const SceneExtent& scene, Vec3 ng, Vec3 d, EmissionDensity& out) const;

  Spectrum power(const SceneExtent& scene) const;
  LightBounds bounds(const Geometry& geometry) const;
  float importance(Vec3 p, Vec3 front) const;

  // Upper bound of the intensity, W / sr.
  Spectrum peak() const { return intensity_ * picture_->maximum(); }
  // W / sr towards d (unit, world).
  Spectrum intensity(Vec3 d) const { return intensity_ * picture_->value(frame_.to_local(d)); }
  Vec3 position() const { return position_; }
  bool black() const { return intensity_.is_black() || !(picture_->mean() > 0); }
  float max_radiance(double scene_radius) const { return radiance_of_point(peak(), scene_radius); }

 private:
  Vec3 position_;
  Frame frame_;
  Spectrum intensity_;
  float strength_;  // of intensity_
  std::shared_ptr<const DirectionPicture> picture_;
};

}  // namespace candela::scene
