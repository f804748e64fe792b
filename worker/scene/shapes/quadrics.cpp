#include "worker/scene/shapes/quadrics.h"

#include <cmath>

#include "worker/core/math.h"
#include "worker/scene/shapes/rounding.h"

namespace candela::scene {
namespace {

// Error of cancellation in double, at the size of the primitive.
constexpr double kDoubleNoise = 0x1p-40;
// If the surface is straight, a direction that grazes it by the normal rounded to float may dip below the
// true one by this for each unit of length. (A sphere curves away from it.)
constexpr double kGrazing = 4 * static_cast<double>(kHalfUlp);

// Half the extent of a circle with axes s and t along each coordinate.
Vec3d circle_extent(Vec3d s, Vec3d t, double radius) {
  return Vec3d{std::sqrt(s.x * s.x + t.x * t.x), std::sqrt(s.y * s.y + t.y * t.y),
               std::sqrt(s.z * s.z + t.z * t.z)} *
         radius;
}

// Turns around a circle from its first axis, in [0, 1).
float turns(double along_s, double along_t) {
  const float u =
      math::atan2f(static_cast<float>(along_t), static_cast<float>(along_s)) * (0.5f * math::kInvPi);
  return u < 0 ? std::min(u + 1, 0x1.fffffep-1f) : u;
}

// Solves |f + d t| = radius. The discriminant from the distance of the line to the center, which does not
// cancel far away (Haines et al. 2019).
bool roots(Vec3d f, Vec3d d, double radius, double& near, double& far) {
  const double a = dot(d, d);
  if (!(a > 0)) return false;
  const double b = -dot(f, d) / a;
  const Vec3d closest = f + d * b;
  const double rest = radius * radius - dot(closest, closest);
  if (!(rest >= 0)) return false;
  const double half = std::sqrt(rest / a);
  // The root far from zero is sure; the other one follows from the product of both, which is exact near
  // the surface.
  const double product = (dot(f, f) - radius * radius) / a;
  const double sure = b >= 0 ? b + half : b - half;
  const double other = sure != 0 ? product / sure : 0.0;
  near = std::min(sure, other);
  far = std::max(sure, other);
  return true;
}

}  // namespace

// ---- spheres ----

Bounds bounds_of(const Sphere& s) {
  const Vec3d r{s.radius, s.radius, s.radius};
  return {s.center - r, s.center + r};
}

bool sphere_distances(const Sphere& sphere, Vec3d origin, Vec3d direction, double& near, double& far) {
  return roots(origin - sphere.center, direction, sphere.radius, near, far);
}

bool meet(const Sphere& sphere, Vec3d origin, Vec3d direction, double t_min, double t_max, double& t) {
  double near = 0, far = 0;
  if (!sphere_distances(sphere, origin, direction, near, far)) return false;
  t = near > t_min ? near : far;
  return t > t_min && t < t_max;
}

Vec2 sphere_uv(const Sphere& sphere, Vec3d n) {
  // u turns around the local z axis, v falls from it.
  const Vec3d local{dot(sphere.axes[0], n), dot(sphere.axes[1], n), dot(sphere.axes[2], n)};
  const auto radial = static_cast<float>(std::sqrt(local.x * local.x + local.y * local.y));
  return {turns(local.x, local.y), math::atan2f(radial, static_cast<float>(local.z)) * math::kInvPi};
}

float sphere_error(const Sphere& sphere, Vec3 p, Vec3 ng) {
  return rounding_error(ng, p) + curvature_error(p, sphere.radius) +
         static_cast<float>(sphere.radius * kDoubleNoise);
}

// ---- disks ----

Bounds bounds_of(const Disk& d) {
  const Vec3d extent = circle_extent(d.axes[0], d.axes[1], d.radius);
  return {d.center - extent, d.center + extent};
}

bool meet(const Disk& disk, Vec3d origin, Vec3d direction, double t_min, double t_max, double& t) {
  const Vec3d to_center = disk.center - origin;
  const double fall = dot(direction, disk.axes[2]);
  if (fall == 0) return false;
  t = dot(to_center, disk.axes[2]) / fall;
  if (!(t > t_min && t < t_max)) return false;
  return length_squared(direction * t - to_center) <= disk.radius * disk.radius;
}

Vec2 disk_uv(const Disk& disk, Vec3d p) {
  const Vec3d f = p - disk.center;
  const double x = dot(f, disk.axes[0]), y = dot(f, disk.axes[1]);
  return {std::min(1.0f, static_cast<float>(std::sqrt(x * x + y * y) / disk.radius)), turns(x, y)};
}

float disk_error(const Disk& disk, Vec3 p) {
  return rounding_error(Vec3(disk.axes[2]), p) + static_cast<float>(2 * disk.radius * kGrazing);
}

// ---- cylinders ----

Bounds bounds_of(const Cylinder& c) {
  const Vec3d extent = circle_extent(c.axes[0], c.axes[1], c.radius);
  const Vec3d end = c.base + c.axes[2] * c.length;
  Bounds out;
  out.add(c.base - extent);
  out.add(c.base + extent);
  out.add(end - extent);
  out.add(end + extent);
  return out;
}

bool meet(const Cylinder& c, Vec3d origin, Vec3d direction, double t_min, double t_max, double& t) {
  const Vec3d f = origin - c.base;
  const double height = dot(f, c.axes[2]), climb = dot(direction, c.axes[2]);
  double near = 0, far = 0;
  if (!roots(f - c.axes[2] * height, direction - c.axes[2] * climb, c.radius, near, far)) return false;
  for (const double root : {near, far}) {
    const double z = height + climb * root;
    if (root > t_min && root < t_max && z >= 0 && z <= c.length) {
      t = root;
      return true;
    }
  }
  return false;
}

Vec2 cylinder_uv(const Cylinder& c, Vec3d p) {
  const Vec3d f = p - c.base;
  return {turns(dot(f, c.axes[0]), dot(f, c.axes[1])),
          static_cast<float>(std::clamp(dot(f, c.axes[2]) / c.length, 0.0, 1.0))};
}

float cylinder_error(const Cylinder& c, Vec3 p, Vec3 ng) {
  return rounding_error(ng, p) + curvature_error(p, c.radius) +
         static_cast<float>(c.radius * kDoubleNoise + c.length * kGrazing);
}

}  // namespace candela::scene
