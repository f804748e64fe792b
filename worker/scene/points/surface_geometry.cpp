#include "worker/scene/points/surface_geometry.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace candela::scene {
namespace {

// u and v beyond it, about the one point that a projection leaves out, are as good as it: 1e-70 away.
constexpr double kFarthest = 1e70;

PrimitiveKind kind_of(const CanonicalPoint& point) {
  return static_cast<PrimitiveKind>(point.kind);
}

// The derivative of v / |v|, given those of v.
Vec3d normalized_change(Vec3d unit, double length, Vec3d change) {
  return (change - unit * dot(unit, change)) / length;
}

Vec3d along(const std::array<Vec3d, 3>& axes, double x, double y, double z) {
  return axes[0] * x + axes[1] * y + axes[2] * z;
}
Vec3d to_axes(const std::array<Vec3d, 3>& axes, Vec3d v) {
  return {dot(axes[0], v), dot(axes[1], v), dot(axes[2], v)};
}

void set_round_normal(SurfaceGeometry& out, Vec3d n, Vec3d dn_du, Vec3d dn_dv, bool inside_out) {
  const double side = inside_out ? -1 : 1;
  out.ng = n * side;
  out.dng_du = dn_du * side;
  out.dng_dv = dn_dv * side;
  out.n = out.ng;
  out.dn_du = out.dng_du;
  out.dn_dv = out.dng_dv;
}

// ---- triangles ----

SurfaceGeometry triangle_geometry(const Geometry& geometry, std::uint32_t index, double u, double v) {
  const Triangle& t = geometry.triangles[index];
  const Vec3d v0(t.v0);
  SurfaceGeometry out;
  out.dp_du = Vec3d(t.v1) - v0;
  out.dp_dv = Vec3d(t.v2) - v0;
  out.p = v0 + out.dp_du * u + out.dp_dv * v;
  out.ng = normalize(cross(out.dp_du, out.dp_dv));
  out.n = out.ng;
  if (!t.smooth) return out;
  const auto& corner = geometry.indices[index];
  const Vec3d n0(geometry.normals[corner[0]]), n1(geometry.normals[corner[1]]),
      n2(geometry.normals[corner[2]]);
  const Vec3d mean = n0 * (1 - u - v) + n1 * u + n2 * v;
  const double l = length(mean);
  // As Geometry::triangle_hit has it: the face decides where vertex normals spread too far.
  if (!(l > 1e-6 && dot(mean, Vec3d(t.ng)) > 1e-6 * l)) return out;
  out.n = mean / l;
  out.dn_du = normalized_change(out.n, l, n1 - n0);
  out.dn_dv = normalized_change(out.n, l, n2 - n0);
  return out;
}

void set_barycentric(CanonicalPoint& point, double b1, double b2) {
  point.u = std::clamp(b1, 0.0, 1.0);
  point.v = std::clamp(b2, 0.0, 1.0);
  if (const double sum = point.u + point.v; sum > 1) {
    point.u /= sum;
    point.v /= sum;
  }
}

void set_on_triangle(const Triangle& t, Vec3d p, CanonicalPoint& point) {
  const Vec3d e1 = Vec3d(t.v1) - Vec3d(t.v0), e2 = Vec3d(t.v2) - Vec3d(t.v0), s = p - Vec3d(t.v0);
  const Vec3d n = cross(e1, e2);
  const double area2 = dot(n, n);
  set_barycentric(point, dot(cross(s, e2), n) / area2, dot(cross(e1, s), n) / area2);
}

// Moeller and Trumbore 1997.
bool meet_triangle(const Triangle& t, Vec3d origin, Vec3d d, CanonicalPoint& point) {
  const Vec3d e1 = Vec3d(t.v1) - Vec3d(t.v0), e2 = Vec3d(t.v2) - Vec3d(t.v0), s = origin - Vec3d(t.v0);
  const double determinant = -dot(d, cross(e1, e2));
  if (!(std::abs(determinant) > 0)) return false;
  const Vec3d moment = cross(s, d);
  set_barycentric(point, dot(e2, moment) / determinant, -dot(e1, moment) / determinant);
  return true;
}

// ---- spheres ----

SurfaceGeometry sphere_geometry(const Sphere& sphere, double u, double v) {
  const double w = 1 / (1 + u * u + v * v), w2 = w * w;
  const Vec3d n = along(sphere.axes, 2 * u * w, 2 * v * w, 1 - 2 * w);
  const Vec3d dn_du = along(sphere.axes, 2 * w - 4 * u * u * w2, -4 * u * v * w2, 4 * u * w2);
  const Vec3d dn_dv = along(sphere.axes, -4 * u * v * w2, 2 * w - 4 * v * v * w2, 4 * v * w2);
  SurfaceGeometry out;
  out.p = sphere.center + n * sphere.radius;
  out.dp_du = dn_du * sphere.radius;
  out.dp_dv = dn_dv * sphere.radius;
  set_round_normal(out, n, dn_du, dn_dv, sphere.inside_out);
  return out;
}

void set_on_sphere(const Sphere& sphere, Vec3d p, CanonicalPoint& point) {
  const Vec3d n = to_axes(sphere.axes, normalize(p - sphere.center));
  const double r2 = n.x * n.x + n.y * n.y;
  // 1 - z in the form that does not cancel.
  const double below = n.z > 0 ? r2 / (1 + n.z) : 1 - n.z;
  point.u = n.x / below;
  point.v = n.y / below;
  const double most = std::max(std::abs(point.u), std::abs(point.v));
  if (!(most < kFarthest)) {
    point.u = kFarthest;
    point.v = 0;
  }
}

// ---- disks ----

SurfaceGeometry disk_geometry(const Disk& disk, double u, double v) {
  SurfaceGeometry out;
  out.dp_du = disk.axes[0] * disk.radius;
  out.dp_dv = disk.axes[1] * disk.radius;
  out.p = disk.center + out.dp_du * u + out.dp_dv * v;
  set_round_normal(out, disk.axes[2], {}, {}, false);
  return out;
}

void set_on_disk(const Disk& disk, Vec3d p, CanonicalPoint& point) {
  const Vec3d f = (p - disk.center) / disk.radius;
  point.u = dot(f, disk.axes[0]);
  point.v = dot(f, disk.axes[1]);
  const double r = std::sqrt(point.u * point.u + point.v * point.v);
  if (r > 1) {
    point.u /= r;
    point.v /= r;
  }
}

// ---- cylinders ----

SurfaceGeometry cylinder_geometry(const Cylinder& cylinder, double u, double v) {
  const double w = 1 / (1 + u * u), w2 = w * w;
  const Vec3d n = along(cylinder.axes, u * u <= 1 ? (1 - u * u) * w : 2 * w - 1, 2 * u * w, 0);
  const Vec3d dn = along(cylinder.axes, -4 * u * w2, 2 * w - 4 * u * u * w2, 0);
  SurfaceGeometry out;
  out.p = cylinder.base + cylinder.axes[2] * (cylinder.length * v) + n * cylinder.radius;
  out.dp_du = dn * cylinder.radius;
  out.dp_dv = cylinder.axes[2] * cylinder.length;
  set_round_normal(out, n, dn, {}, cylinder.inside_out);
  return out;
}

void set_on_cylinder(const Cylinder& cylinder, Vec3d p, CanonicalPoint& point) {
  const Vec3d f = to_axes(cylinder.axes, p - cylinder.base);
  const double r = std::sqrt(f.x * f.x + f.y * f.y);
  const double x = f.x / r, y = f.y / r;
  point.u = x >= 0 ? y / (1 + x) : (1 - x) / y;
  if (!(std::abs(point.u) < kFarthest)) point.u = kFarthest;
  point.v = std::clamp(f.z / cylinder.length, 0.0, 1.0);
}

// ---- all kinds, in the coordinates of their group ----

SurfaceGeometry local_geometry(const Geometry& geometry, const CanonicalPoint& point) {
  switch (kind_of(point)) {
    case PrimitiveKind::triangle:
      return triangle_geometry(geometry, point.primitive, point.u, point.v);
    case PrimitiveKind::sphere:
      return sphere_geometry(geometry.spheres[point.primitive].sphere, point.u, point.v);
    case PrimitiveKind::disk:
      return disk_geometry(geometry.disks[point.primitive].disk, point.u, point.v);
    case PrimitiveKind::cylinder:
      break;
  }
  return cylinder_geometry(geometry.cylinders[point.primitive].cylinder, point.u, point.v);
}

void set_local_place(const Geometry& geometry, Vec3d p, CanonicalPoint& point) {
  switch (kind_of(point)) {
    case PrimitiveKind::triangle:
      return set_on_triangle(geometry.triangles[point.primitive], p, point);
    case PrimitiveKind::sphere:
      return set_on_sphere(geometry.spheres[point.primitive].sphere, p, point);
    case PrimitiveKind::disk:
      return set_on_disk(geometry.disks[point.primitive].disk, p, point);
    case PrimitiveKind::cylinder:
      return set_on_cylinder(geometry.cylinders[point.primitive].cylinder, p, point);
  }
}

// Distances along the line, in lengths of d; none: it misses.
std::size_t local_meetings(const Geometry& geometry, const CanonicalPoint& point, Vec3d origin, Vec3d d,
                           std::array<double, 2>& t) {
  if (kind_of(point) == PrimitiveKind::disk) {
    const Disk& disk = geometry.disks[point.primitive].disk;
    const double fall = dot(d, disk.axes[2]);
    t[0] = dot(disk.center - origin, disk.axes[2]) / fall;
    return fall != 0 ? 1 : 0;
  }
  if (kind_of(point) == PrimitiveKind::sphere)
    return sphere_distances(geometry.spheres[point.primitive].sphere, origin, d, t[0], t[1]) ? 2 : 0;
  // A cylinder is met as a sphere is in the plane across its axis.
  const Cylinder& cylinder = geometry.cylinders[point.primitive].cylinder;
  const auto flat = [&](Vec3d v) { return v - cylinder.axes[2] * dot(v, cylinder.axes[2]); };
  const Sphere round{{}, cylinder.radius, {}, false};
  return sphere_distances(round, flat(origin - cylinder.base), flat(d), t[0], t[1]) ? 2 : 0;
}

}  // namespace

SurfaceGeometry surface_geometry(const Geometry& geometry, const CanonicalPoint& point) {
  SurfaceGeometry out = local_geometry(geometry, point);
  if (point.instance == kNone) return out;
  const Transform& to_world = geometry.instances[point.instance].to_world;
  out.p = to_world.point(out.p);
  out.dp_du = to_world.vector(out.dp_du);
  out.dp_dv = to_world.vector(out.dp_dv);
  const auto turn = [&](Vec3d& n, Vec3d& dn_du, Vec3d& dn_dv) {
    const Vec3d climb = to_world.covector(n);
    const double l = length(climb);
    n = climb / l;
    dn_du = normalized_change(n, l, to_world.covector(dn_du));
    dn_dv = normalized_change(n, l, to_world.covector(dn_dv));
  };
  turn(out.ng, out.dng_du, out.dng_dv);
  turn(out.n, out.dn_du, out.dn_dv);
  // As Geometry::instance_hit has it.
  if (dot(out.n, out.ng) > 1e-6) return out;
  out.n = out.ng;
  out.dn_du = out.dng_du;
  out.dn_dv = out.dng_dv;
  return out;
}

LocalSpot local_spot(const Geometry& geometry, const CanonicalPoint& point) {
  if (kind_of(point) != PrimitiveKind::triangle) {
    const SurfaceGeometry all = local_geometry(geometry, point);
    return {all.p, all.ng};
  }
  const Triangle& t = geometry.triangles[point.primitive];
  const Vec3d v0(t.v0), e1 = Vec3d(t.v1) - v0, e2 = Vec3d(t.v2) - v0;
  return {v0 + e1 * point.u + e2 * point.v, normalize(cross(e1, e2))};
}

void set_place(const Geometry& geometry, Vec3d p, CanonicalPoint& point) {
  if (point.instance != kNone) p = geometry.instances[point.instance].to_world.inverse_point(p);
  set_local_place(geometry, p, point);
}

bool set_meeting_on_triangle(const Geometry& geometry, Vec3d origin, Vec3d direction, CanonicalPoint& point) {
  if (kind_of(point) != PrimitiveKind::triangle) return false;
  if (point.instance != kNone) {
    const Transform& to_world = geometry.instances[point.instance].to_world;
    origin = to_world.inverse_point(origin);
    direction = to_world.inverse_vector(direction);
  }
  return meet_triangle(geometry.triangles[point.primitive], origin, direction, point);
}

void set_meeting(const Geometry& geometry, Vec3d origin, Vec3d direction, Vec3d near, CanonicalPoint& point) {
  if (point.instance != kNone) {
    const Transform& to_world = geometry.instances[point.instance].to_world;
    origin = to_world.inverse_point(origin);
    direction = to_world.inverse_vector(direction);
    near = to_world.inverse_point(near);
  }
  if (kind_of(point) == PrimitiveKind::triangle) {
    if (!meet_triangle(geometry.triangles[point.primitive], origin, direction, point))
      set_local_place(geometry, near, point);
    return;
  }
  std::array<double, 2> t{};
  const std::size_t count = local_meetings(geometry, point, origin, direction, t);
  Vec3d best = near;
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3d p = origin + direction * t[i];
    const double distance = length_squared(p - near);
    if (!(distance < nearest)) continue;
    nearest = distance;
    best = p;
  }
  set_local_place(geometry, best, point);
}

bool exists(const Geometry& geometry, const CanonicalPoint& point) {
  if (point.kind >= kPrimitiveKinds || !std::isfinite(point.u) || !std::isfinite(point.v)) return false;
  if (point.instance != kNone && point.instance >= geometry.instances.size()) return false;
  const std::size_t group = point.instance == kNone ? 0 : geometry.instances[point.instance].group;
  const Group::Range range = geometry.groups[group].primitives[point.kind];
  if (point.primitive < range.first || point.primitive - range.first >= range.count) return false;
  const double u = point.u, v = point.v;
  switch (kind_of(point)) {
    case PrimitiveKind::triangle:
      return u >= 0 && v >= 0 && u + v <= 1 + 1e-12;
    case PrimitiveKind::sphere:
      return std::max(std::abs(u), std::abs(v)) <= kFarthest;
    case PrimitiveKind::disk:
      return u * u + v * v <= 1 + 1e-12;
    case PrimitiveKind::cylinder:
      break;
  }
  return std::abs(u) <= kFarthest && v >= 0 && v <= 1;
}

std::uint32_t shape_of(const Geometry& geometry, const CanonicalPoint& point) {
  switch (kind_of(point)) {
    case PrimitiveKind::triangle:
      return geometry.triangles[point.primitive].shape;
    case PrimitiveKind::sphere:
      return geometry.spheres[point.primitive].shape;
    case PrimitiveKind::disk:
      return geometry.disks[point.primitive].shape;
    case PrimitiveKind::cylinder:
      break;
  }
  return geometry.cylinders[point.primitive].shape;
}

}  // namespace candela::scene
