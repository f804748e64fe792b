// Spheres, disks and cylinders: kept in double, since rays meet them in our own arithmetic.
//
// For each kind: its box; meet(), the nearest distance along a ray within an open interval; and Mitsuba's
// parameterization of a point on it.
#pragma once

#include <array>

#include "worker/core/vec.h"
#include "worker/scene/bounds.h"

namespace candela::scene {

struct Sphere {
  Vec3d center;
  double radius = 0;
  std::array<Vec3d, 3> axes{};  // of the parameterization, orthonormal (a mirror is possible)
  bool inside_out = false;      // flip_normals: the outside, where it emits, is within
};

struct Disk {
  Vec3d center;
  double radius = 0;
  std::array<Vec3d, 3> axes{};  // orthonormal; the angle grows from the first to the second (a mirror is
                                // possible), the third is the front's normal
};

// The mantle alone: it has no caps.
struct Cylinder {
  Vec3d base;  // where the axis begins
  double radius = 0, length = 0;
  std::array<Vec3d, 3> axes{};  // orthonormal, the third along the axis; the angle as for a disk
  bool inside_out = false;
};

Bounds bounds_of(const Sphere& sphere);
Bounds bounds_of(const Disk& disk);
Bounds bounds_of(const Cylinder& cylinder);

// Distances along the ray, in lengths of `direction`, where it meets the sphere; false: it does not.
bool sphere_distances(const Sphere& sphere, Vec3d origin, Vec3d direction, double& near, double& far);

// The nearest meeting in (t_min, t_max). A start that lies on the surface but for rounding has a root of
// about zero there, which is no meeting.
bool meet(const Sphere& sphere, Vec3d origin, Vec3d direction, double t_min, double t_max, double& t);
bool meet(const Disk& disk, Vec3d origin, Vec3d direction, double t_min, double t_max, double& t);
bool meet(const Cylinder& cylinder, Vec3d origin, Vec3d direction, double t_min, double t_max, double& t);

// Mitsuba's parameterization. Sphere: of the point in direction n (unit) from the center, (angle around the
// local z axis, angle from it). Disk: (radius, angle). Cylinder: (angle, height). All over [0, 1].
Vec2 sphere_uv(const Sphere& sphere, Vec3d n);
Vec2 disk_uv(const Disk& disk, Vec3d p);
Vec2 cylinder_uv(const Cylinder& cylinder, Vec3d p);

// Error bounds of points on them, as SurfaceHit's error: p is the point after rounding to float, ng the
// normal there.
float sphere_error(const Sphere& sphere, Vec3 p, Vec3 ng);
float disk_error(const Disk& disk, Vec3 p);
float cylinder_error(const Cylinder& cylinder, Vec3 p, Vec3 ng);

}  // namespace candela::scene
