// Mitsuba's perspective pinhole camera. In its own space it looks along +z with y up and x to the LEFT of the
// image.
#pragma once

#include "common/base/result.h"
#include "common/description/object.h"
#include "worker/core/vec.h"

namespace candela::scene {

class PerspectiveSensor {
 public:
  // The film's size in pixels; the field of view refers to it.
  static Result<PerspectiveSensor> build(const description::Object& sensor, std::uint32_t film_width,
                                         std::uint32_t film_height);

  // Through film position (x, y) in pixels, (0, 0) the top left corner. Starts at the near plane, ends at the
  // far one.
  Ray ray(float film_x, float film_y) const {
    const Vec3d d = axis_ + across_ * static_cast<double>(film_x) + down_ * static_cast<double>(film_y);
    const double l = length(d);  // distance of the plane at unit depth along this ray
    const Vec3d unit = d / l;
    return {Vec3(origin_ + unit * (near_clip_ * l)), Vec3(unit),
            static_cast<float>((far_clip_ - near_clip_) * l)};
  }

  Vec3 origin() const { return Vec3(origin_); }
  double horizontal_fov_degrees() const { return horizontal_fov_degrees_; }

 private:
  Vec3d origin_;
  Vec3d axis_;           // the point (0, 0) of the film at unit depth, from the origin
  Vec3d across_, down_;  // one pixel to the right, one down
  double near_clip_ = 0, far_clip_ = 0;
  double horizontal_fov_degrees_ = 0;
};

}  // namespace candela::scene
