// The triangles of one shape that emit, sampled uniformly in area; or in the solid angle of one of them.
#pragma once

#include <cstdint>

#include "worker/core/vec.h"
#include "worker/scene/emitters/area_light.h"
#include "worker/scene/emitters/distribution.h"

namespace candela::scene {

// The triangles of a mesh, each by its area.
Distribution triangles_by_area(const Geometry& geometry, std::uint32_t shape);

class MeshSurface {
 public:
  static constexpr bool kNormalsVary = false;
  static constexpr bool kReachesAll = true;
  static constexpr bool kReadsRest = true;  // it chooses the triangle

  // The geometry must outlive this.
  MeshSurface(const Geometry& geometry, std::uint32_t shape);
  bool reaches(Vec3 /*reference*/) const { return true; }
  bool sample(Vec3 reference, double rest, Vec2 u, LightPoint& out) const;
  float pdf_solid_angle(Vec3 reference, const SurfaceHit& hit) const;
  // spherical: a triangle by its area, and a point of it uniform in solid angle. The others: as above.
  bool sample_by(PointSampler sampler, Vec3 reference, Vec3 front, double rest, Vec2 u,
                 LightPoint& out) const;
  float pdf_by_solid_angle(PointSampler sampler, Vec3 reference, Vec3 front, const SurfaceHit& hit) const;
  void sample_area(double rest, Vec2 u, LightPoint& out) const;
  double area() const { return triangles_.total(); }
  void find_uv(LightPoint& /*point*/) const {}

 private:
  // A point of the triangle by barycentric coordinates.
  void place(std::uint32_t triangle, Vec3 p, Vec2 barycentric, LightPoint& out) const;

  const Geometry* geometry_;
  std::uint32_t first_;
  Distribution triangles_;
};

using MeshLight = AreaLight<MeshSurface>;
extern template class AreaLight<MeshSurface>;

SurfaceExtent extent_of_triangles(const Geometry& geometry, std::uint32_t shape);
// The largest position error at a corner of the shape's triangles.
float corner_error(const Geometry& geometry, std::uint32_t shape);

}  // namespace candela::scene
