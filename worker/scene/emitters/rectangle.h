// A parallelogram that emits. Near ones are sampled uniformly in solid angle where they are rectangles
// [Urena, Fajardo, King 2013, "An area-preserving parametrization for spherical rectangles"], far ones
// (center beyond kNearDiagonals diagonals, where the two differ little and this is several times cheaper) and
// sheared ones uniformly in area.
#pragma once

#include "worker/core/vec.h"
#include "worker/scene/emitters/area_light.h"

namespace candela::scene {

class RectangleSurface {
 public:
  static constexpr bool kNormalsVary = false;
  static constexpr bool kReadsRest = false;
  static constexpr float kNearDiagonals = 1.5;

  RectangleSurface(const Rectangle& rectangle, float error);
  // The reference is strictly in front.
  bool reaches(Vec3 reference) const { return dot(reference - rectangle_.corner, rectangle_.normal) > 0; }
  bool sample(Vec3 reference, double rest, Vec2 u, LightPoint& out) const;
  float pdf_solid_angle(Vec3 reference, const SurfaceHit& hit) const;
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

  Rectangle rectangle_;
  Vec3d axis_u_, axis_v_;  // unit
  Vec3 center_;
  double length_u_, length_v_, area_;
  float near_squared_;  // squared distance of the center below which solid angle is sampled; 0: never
  float error_;
};

using RectangleLight = AreaLight<RectangleSurface>;
extern template class AreaLight<RectangleSurface>;

}  // namespace candela::scene
