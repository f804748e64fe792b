// A parallelogram that emits. On its own, near ones are sampled uniformly in solid angle where they are
// rectangles [Urena, Fajardo, King 2013, "An area-preserving parametrization for spherical rectangles"], far
// ones (center beyond kNearDiagonals diagonals, where the two differ little and this is several times
// cheaper) and sheared ones uniformly in area.
#pragma once

#include <array>

#include "worker/core/vec.h"
#include "worker/scene/emitters/area_light.h"
#include "worker/scene/emitters/points/parallel_projection.h"
#include "worker/scene/emitters/points/spherical_rectangle.h"
#include "worker/scene/emitters/points/spherical_triangle.h"

namespace candela::scene {

class RectangleSurface {
 public:
  static constexpr bool kNormalsVary = false;
  static constexpr bool kReadsRest = false;
  static constexpr float kNearDiagonals = 1.5;

  RectangleSurface(const Rectangle& rectangle, float error);
  // The reference is strictly in front.
  bool reaches(Vec3 reference) const { return dot(reference - rectangle_.corner, rectangle_.normal) > 0; }
  // The plane that reaches() reads.
  void plane(Vec3& corner, Vec3& normal) const {
    corner = rectangle_.corner;
    normal = rectangle_.normal;
  }
  bool sample(Vec3 reference, double rest, Vec2 u, LightPoint& out) const;
  float pdf_solid_angle(Vec3 reference, const SurfaceHit& hit) const;
  // Sheared ones are two triangles to `spherical`. `parallel` without a front is `area`.
  bool sample_by(PointSampler sampler, Vec3 reference, Vec3 front, double rest, Vec2 u,
                 LightPoint& out) const;
  float pdf_by_solid_angle(PointSampler sampler, Vec3 reference, Vec3 front, const SurfaceHit& hit) const;
  void sample_area(double rest, Vec2 u, LightPoint& out) const;
  double area() const { return area_; }
  void find_uv(LightPoint& /*point*/) const {}

 private:
  struct Spherical {
    double x0, x1, y0, y1, z0;  // the rectangle's corners from the reference, z0 < 0
    double b0, b1, k;
    double solid_angle;
  };
  bool spherical(Vec3 reference, Spherical& out) const;
  // The corner as `spherical` and `parallel` of sample_by() see it from the reference.
  Vec3d from(Vec3 reference) const { return Vec3d(rectangle_.corner) - Vec3d(reference); }
  double volume(Vec3 reference) const { return -dot(from(reference), Vec3d(rectangle_.normal)) * area_; }
  SphericalRectangle rectangle_from(Vec3 reference) const;
  std::array<SphericalTriangle, 2> triangles_from(Vec3 reference) const;
  ParallelProjection projection_from(Vec3 reference, Vec3 front) const;
  double solid_angle_from(Vec3 reference) const;
  // A point by its coordinates along the edges, and its direction.
  void place(Vec3 reference, TVec2<double> at, LightPoint& out) const;

  Rectangle rectangle_;
  Vec3d axis_u_, axis_v_;  // unit
  Vec3 center_;
  double length_u_, length_v_, area_;
  bool right_angled_;
  float near_squared_;  // squared distance of the center below which solid angle is sampled; 0: never
  float error_;
};

using RectangleLight = AreaLight<RectangleSurface>;
extern template class AreaLight<RectangleSurface>;

}  // namespace candela::scene
