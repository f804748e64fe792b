// A sphere that emits. It is sampled uniformly in the solid angle of the visible cap from outside, over all
// directions from inside.
#pragma once

#include "worker/core/vec.h"
#include "worker/scene/emitters/area_light.h"

namespace candela::scene {

class SphereSurface {
 public:
  static constexpr bool kNormalsVary = true;
  static constexpr bool kReachesAll = false;
  static constexpr bool kReadsRest = false;

  explicit SphereSurface(const Sphere& sphere) : sphere_(sphere) {}
  SurfaceExtent extent() const;
  bool reaches(Vec3 reference) const { return inside(reference) == sphere_.inside_out; }
  bool sample(Vec3 reference, double rest, Vec2 u, LightPoint& out) const;
  float pdf_solid_angle(Vec3 reference, const SurfaceHit& hit) const;
  void sample_area(double rest, Vec2 u, LightPoint& out) const;
  double area() const;
  void find_uv(LightPoint& point) const;

 private:
  bool inside(Vec3 reference) const {
    return length_squared(Vec3d(reference) - sphere_.center) <= sphere_.radius * sphere_.radius;
  }
  // 1 - cos of the half angle of the cap seen from outside.
  double one_minus_cos(double distance_squared) const;

  Sphere sphere_;
};

using SphereLight = AreaLight<SphereSurface>;
extern template class AreaLight<SphereSurface>;

}  // namespace candela::scene
