// A disk that emits, sampled uniformly in area.
#pragma once

#include "worker/core/vec.h"
#include "worker/scene/emitters/area_light.h"

namespace candela::scene {

class DiskSurface {
 public:
  static constexpr bool kNormalsVary = false;
  static constexpr bool kReachesAll = false;
  static constexpr bool kReadsRest = false;

  explicit DiskSurface(const Disk& disk) : disk_(disk) {}
  SurfaceExtent extent() const;
  bool reaches(Vec3 reference) const { return dot(Vec3d(reference) - disk_.center, disk_.axes[2]) > 0; }
  bool sample(Vec3 reference, double rest, Vec2 u, LightPoint& out) const;
  float pdf_solid_angle(Vec3 reference, const SurfaceHit& hit) const;
  void sample_area(double rest, Vec2 u, LightPoint& out) const;
  double area() const;
  void find_uv(LightPoint& point) const;

 private:
  Disk disk_;
};

using DiskLight = AreaLight<DiskSurface>;
extern template class AreaLight<DiskSurface>;

}  // namespace candela::scene
