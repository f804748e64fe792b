// Mitsuba's cameras `perspective`, `thinlens`, `orthographic` and `distant`, as one closed set. In its own
// space a camera looks along +z with y up and x to the LEFT of the image.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>

#include "common/base/result.h"
#include "common/description/object.h"
#include "common/job/job.h"
#include "worker/core/vec.h"
#include "worker/core/warp.h"
#include "worker/scene/bounds.h"
#include "worker/scene/camera.h"
#include "worker/scene/hit.h"

namespace candela::scene {

class Sensor {
 public:
  // The image's size in pixels. The field of view refers to the whole film, of which the image is the crop
  // window, or the part `crop` of that.
  static Result<Sensor> build(const description::Object& sensor, std::uint32_t film_width,
                              std::uint32_t film_height, const std::optional<Crop>& crop = {});

  // Parallel rays from outside of the scene, which these bounds enclose: all that pass a target, a disk or a
  // parallelogram. Its film is one pixel. A target that is a point has one ray, which no light path finds.
  static Result<Sensor> build_distant(const description::Object& sensor, const description::FileSource& files,
                                      const Bounds& scene, std::uint32_t film_width,
                                      std::uint32_t film_height);

  // A lens of finite size: rays depend on u_lens. An aperture of radius 0 is a pinhole.
  bool reads_lens() const { return kind_ == Kind::thinlens; }

  // Through film position (x, y) in pixels, (0, 0) the top left corner. Starts at the near plane, ends at the
  // far one.
  Ray ray(float film_x, float film_y, Vec2 u_lens) const {
    Vec3d d = axis_ + across_ * static_cast<double>(film_x) + down_ * static_cast<double>(film_y);
    if (kind_ == Kind::orthographic) {
      return {Vec3(d), Vec3(direction_), reach(1)};
    }
    if (kind_ == Kind::distant) [[unlikely]]
      return {target_point(film_x, film_y), Vec3(direction_)};
    Vec3d origin = origin_;
    if (kind_ == Kind::thinlens) {
      const Vec3d lens = lens_point(u_lens);
      origin += lens;
      d += lens * -inverse_focus_;  // all rays of one film position meet in the plane of focus
    }
    const double l = length(d);  // distance of the plane at unit depth along this ray
    const Vec3d unit = d / l;
    return {Vec3(origin + unit * (near_clip_ * l)), Vec3(unit), reach(l)};
  }

  // Along a unit direction of ray(), from the lens to the near plane; 0 for orthographic and distant cameras.
  double near_distance(Vec3 direction) const {
    return kind_ == Kind::orthographic || kind_ == Kind::distant
               ? 0.0
               : near_clip_ / dot(Vec3d(direction), dual_depth_);
  }

  // A lens point as seen from the reference, uniform over the lens. False: the reference is not on the film,
  // widened by `border` pixels on each side, or not between the clip planes.
  bool sample(const SurfaceHit& reference, Vec2 u_lens, float border, CameraSample& out) const;

  // The densities of ray() choosing the ray that runs along `direction` through `point`, any point on it.
  // False: no ray does (lens missed, outside the film and its border, from behind). A pinhole does not look
  // at the point, an orthographic camera not at the direction. Clip planes are not looked at.
  bool density(Vec3 point, Vec3 direction, float border, CameraDensity& out) const;

  // For light that travels along the ray: the distance at which it passes the near plane on its way through a
  // finite lens onto the film; false: it does not. `out` is of the reversed ray.
  bool intersect(const Ray& ray, float border, float& distance, CameraDensity& out) const;

 private:
  enum class Kind : std::uint8_t { perspective, thinlens, orthographic, distant };

  // From the near plane to the far one along a ray of length l from the film's plane at unit depth; finite.
  float reach(double l) const { return static_cast<float>(std::min((far_clip_ - near_clip_) * l, 3.0e38)); }
  Vec3d lens_point(Vec2 u) const {
    const Vec2 disk = warp::concentric_disk(u);
    return lens_x_ * static_cast<double>(disk.x) + lens_y_ * static_cast<double>(disk.y);
  }
  // distant: where a ray starts.
  Vec3 target_point(float film_x, float film_y) const {
    Vec2 s{std::clamp(film_x, 0.0f, 1.0f), std::clamp(film_y, 0.0f, 1.0f)};
    s = round_ ? warp::concentric_disk(s) : Vec2{2 * s.x - 1, 2 * s.y - 1};
    return Vec3(origin_ + lens_x_ * static_cast<double>(s.x) + lens_y_ * static_cast<double>(s.y));
  }
  // distant: the line through p along the rays passes the target. `depth`: of p behind the target.
  bool on_target(Vec3d p, double& depth) const;
  void finish();          // what inverse mappings need, from the forward one
  bool in_range() const;  // rays begin where they can be traced
  bool on_film(double x, double y, float border) const {
    const double b = static_cast<double>(border);
    return x >= -b && y >= -b && x < width_ + b && y < height_ + b;
  }

  Kind kind_ = Kind::perspective;
  Vec3d origin_;         // of the pinhole, the lens's center
  Vec3d axis_;           // the point (0, 0) of the film at unit depth, from the origin; orthographic: in the
                         // world, on the near plane
  Vec3d across_, down_;  // one pixel to the right, one down
  Vec3d direction_;      // unit; orthographic, distant: of all rays, else the lens's normal
  // Half axes of the lens, or of the distant target around origin_, outside of the scene.
  Vec3d lens_x_, lens_y_;
  bool round_ = false;  // distant: the target is an ellipse
  double inverse_focus_ = 0;
  double near_clip_ = 0, far_clip_ = 0;
  double width_ = 1, height_ = 1;

  // The basis dual to (across, down, depth), depth being axis (orthographic: direction): components of a
  // vector by dot products.
  Vec3d dual_x_, dual_y_, dual_depth_;
  double pixel_ = 1;      // |det(across, down, depth)|: of a pixel, at unit depth
  double lens_area_ = 0;  // m^2
};

}  // namespace candela::scene
