// Sampling of emitting surfaces as seen from a reference point. Each light has sample() and a density that
// depends on the reference and the point found alone, so that both agree whichever technique found the point.
// All emit from their front only.
#pragma once

#include <cstdint>
#include <vector>

#include "worker/core/vec.h"
#include "worker/scene/emitters/distribution.h"
#include "worker/scene/shapes/geometry.h"

namespace candela::scene {

struct LightPoint {
  Vec3 p;
  Vec3 ng;          // of the emitting front
  Vec3 wi;          // unit, from the reference towards p
  Vec2 uv;          // of the shape's parameterisation; not filled for spheres, disks and cylinders, whose
                    // uv follows from p and costs an arc tangent
  float error = 0;  // of p, as in SurfaceHit
  float pdf_solid_angle = 0;
};

// Beside what is said above, each light has sample_area(): a point uniform in area, density 1 / area(), as
// light paths start; it fills p, ng, uv (as above) and error.

// A parallelogram. Near ones are sampled uniformly in solid angle where they are rectangles [Urena, Fajardo,
// King 2013, "An area-preserving parametrization for spherical rectangles"], far ones (centre beyond
// kNearDiagonals diagonals, where the two differ little and this is several times cheaper) and sheared ones
// uniformly in area.
class RectangleLight {
 public:
  RectangleLight(const Rectangle& rectangle, float error);
  // The reference is strictly in front.
  bool reaches(Vec3 reference) const { return dot(reference - rectangle_.corner, rectangle_.normal) > 0; }
  bool sample(Vec3 reference, Vec2 u, LightPoint& out) const;
  float pdf_solid_angle(Vec3 reference, Vec3 p) const;
  void sample_area(Vec2 u, LightPoint& out) const;
  double area() const { return area_; }

  static constexpr float kNearDiagonals = 1.5;

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
  float near_squared_;  // squared distance of the centre below which solid angle is sampled; 0: never
  float error_;
};

// Uniform in the solid angle of the visible cap from outside, over all directions from inside.
class SphereLight {
 public:
  explicit SphereLight(const Sphere& sphere) : sphere_(sphere) {}
  bool reaches(Vec3 reference) const { return inside(reference) == sphere_.inside_out; }
  bool sample(Vec3 reference, Vec2 u, LightPoint& out) const;
  float pdf_solid_angle(Vec3 reference) const;
  void sample_area(Vec2 u, LightPoint& out) const;
  double area() const;

 private:
  bool inside(Vec3 reference) const {
    return length_squared(Vec3d(reference) - sphere_.center) <= sphere_.radius * sphere_.radius;
  }
  // 1 - cos of the half angle of the cap seen from outside.
  double one_minus_cos(double distance_squared) const;

  Sphere sphere_;
};

// Uniform in area.
class DiskLight {
 public:
  explicit DiskLight(const Disk& disk) : disk_(disk) {}
  bool reaches(Vec3 reference) const { return dot(Vec3d(reference) - disk_.center, disk_.axes[2]) > 0; }
  bool sample(Vec3 reference, Vec2 u, LightPoint& out) const;
  float pdf_solid_angle(Vec3 reference, Vec3 p) const;
  void sample_area(Vec2 u, LightPoint& out) const;
  double area() const;

 private:
  Disk disk_;
};

// Uniform in the angle around the reference, in the plane across the axis, and in height: over the side that
// faces the reference alone, and without the singular density at the silhouette that area would have.
class CylinderLight {
 public:
  explicit CylinderLight(const Cylinder& cylinder) : cylinder_(cylinder) {}
  bool reaches(Vec3 reference) const;
  bool sample(Vec3 reference, Vec2 u, LightPoint& out) const;
  float pdf_solid_angle(Vec3 reference, const SurfaceHit& hit) const;
  void sample_area(Vec2 u, LightPoint& out) const;
  double area() const;

 private:
  // The reference across the axis, from it, and half the angle that the circle fills there; false: nothing
  // faces the reference.
  bool across(Vec3 reference, double& x, double& y, double& half) const;

  Cylinder cylinder_;
};

// Uniform in area over the triangles of one shape.
class MeshLight {
 public:
  MeshLight(const Geometry& geometry, std::uint32_t shape);
  bool sample(Vec3 reference, double u_triangle, Vec2 u, LightPoint& out) const;
  float pdf_solid_angle(Vec3 reference, const SurfaceHit& hit) const;
  void sample_area(double u_triangle, Vec2 u, LightPoint& out) const;
  double area() const { return triangles_.total(); }

 private:
  const Geometry* geometry_;
  std::uint32_t first_;
  Distribution triangles_;
};

}  // namespace candela::scene
