// A cylinder's mantle that emits. It is sampled uniformly in the angle around the reference, in the plane
// across the axis, and in height: over the side that faces the reference alone, and without the singular
// density at the silhouette that area would have.
#pragma once

#include "worker/core/vec.h"
#include "worker/scene/emitters/area_light.h"

namespace candela::scene {

class CylinderSurface {
 public:
  static constexpr bool kNormalsVary = true;
  static constexpr bool kReachesAll = false;
  static constexpr bool kReadsRest = false;

  explicit CylinderSurface(const Cylinder& cylinder) : cylinder_(cylinder) {}
  SurfaceExtent extent() const;
  bool reaches(Vec3 reference) const;
  bool sample(Vec3 reference, double rest, Vec2 u, LightPoint& out) const;
  float pdf_solid_angle(Vec3 reference, const SurfaceHit& hit) const;
  void sample_area(double rest, Vec2 u, LightPoint& out) const;
  double area() const;
  void find_uv(LightPoint& point) const;

 private:
  // The reference across the axis, from it, and half the angle that the circle fills there; false: nothing
  // faces the reference.
  bool across(Vec3 reference, double& x, double& y, double& half) const;

  Cylinder cylinder_;
};

using CylinderLight = AreaLight<CylinderSurface>;
extern template class AreaLight<CylinderSurface>;

}  // namespace candela::scene
