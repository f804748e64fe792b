// Mitsuba's spot light: a point that shines into a cone, evenly up to beam_width from the axis and falling
// off linearly in the angle to nothing at cutoff_angle, times an optional texture projected along the axis.
#pragma once

#include "worker/core/vec.h"
#include "worker/scene/textures/texture.h"

namespace candela::scene {

class SpotLight {
 public:
  // frame.n is the axis, frame.s and frame.t span the texture; angles in radians, 0 <= beam <= cutoff <= pi,
  // cutoff > 0 (below pi / 2 with a texture that varies).
  SpotLight(Vec3 position, const Frame& frame, Spectrum intensity, double cutoff, double beam,
            const ColorTexture& texture);

  // W / sr towards d (unit, world).
  Spectrum intensity(Vec3 d) const;
  // Uniform in the cone, with its density.
  Vec3 sample(Vec2 u) const;
  float pdf_solid_angle(Vec3 d) const;

  Vec3 position() const { return position_; }
  Vec3 axis() const { return frame_.n; }
  float cos_cutoff() const { return cos_cutoff_; }
  float beam() const { return beam_; }      // radians
  float cutoff() const { return cutoff_; }  // radians
  // W; by quadrature where there is a texture, analytic otherwise.
  Spectrum power() const { return power_; }
  Spectrum peak() const { return intensity_ * texture_.maximum(); }

 private:
  float falloff(Vec3 local) const;

  Vec3 position_;
  Frame frame_;
  Spectrum intensity_;
  ColorTexture texture_;
  float cutoff_, beam_, cos_cutoff_, inverse_transition_, inverse_tangent_;
  float one_minus_cos_;  // of the cutoff, without its cancellation
  Spectrum power_;
};

}  // namespace candela::scene
