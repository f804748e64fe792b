#include "worker/scene/irradiance_meter.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "worker/core/measure.h"
#include "worker/core/warp.h"
#include "worker/scene/emitters/double_math.h"
#include "worker/scene/emitters/mesh.h"

namespace candela::scene {
namespace {

constexpr double kPi = std::numbers::pi;

float within(double x) {
  return static_cast<float>(std::clamp(x, 0.0, 1.0 - 0x1p-24));
}

}  // namespace

IrradianceMeter::IrradianceMeter(const Geometry& geometry, std::uint32_t shape,
                                 const std::optional<Rectangle>& rectangle, std::uint32_t film_width,
                                 std::uint32_t film_height)
    : geometry_(&geometry),
      record_(geometry.shapes[shape]),
      shape_(shape),
      rectangle_(rectangle),
      width_(static_cast<float>(film_width)),
      height_(static_cast<float>(film_height)) {
  if (record_.sphere != kNone) {
    const double r = geometry.spheres[record_.sphere].sphere.radius;
    area_ = 4 * kPi * r * r;
  } else if (record_.disk != kNone) {
    const double r = geometry.disks[record_.disk].disk.radius;
    area_ = kPi * r * r;
  } else if (record_.cylinder != kNone) {
    const Cylinder& cylinder = geometry.cylinders[record_.cylinder].cylinder;
    area_ = 2 * kPi * cylinder.radius * cylinder.length;
  } else {
    triangles_ = triangles_by_area(geometry, shape);
    area_ = triangles_.total();
    corner_error_ = corner_error(geometry, shape);
  }
}

IrradianceMeter::Place IrradianceMeter::place(Vec2 s) const {
  Place out;
  const auto x = static_cast<double>(s.x), y = static_cast<double>(s.y);
  double sine = 0, cosine = 0;
  if (record_.sphere != kNone) {
    const Sphere& sphere = geometry_->spheres[record_.sphere].sphere;
    const double z = 1 - 2 * y, r = 2 * std::sqrt(y * (1 - y));
    sincos_double(2 * kPi * x, sine, cosine);
    const Vec3d n = sphere.axes[0] * (r * cosine) + sphere.axes[1] * (r * sine) + sphere.axes[2] * z;
    out.p = Vec3(sphere.center + n * sphere.radius);
    out.ng = Vec3(sphere.inside_out ? -n : n);
    out.error = sphere_error(sphere, out.p, out.ng);
  } else if (record_.disk != kNone) {
    const Disk& disk = geometry_->disks[record_.disk].disk;
    const double r = disk.radius * std::sqrt(x);
    sincos_double(2 * kPi * y, sine, cosine);
    out.p = Vec3(disk.center + disk.axes[0] * (r * cosine) + disk.axes[1] * (r * sine));
    out.ng = Vec3(disk.axes[2]);
    out.error = disk_error(disk, out.p);
  } else if (record_.cylinder != kNone) {
    const Cylinder& cylinder = geometry_->cylinders[record_.cylinder].cylinder;
    sincos_double(2 * kPi * x, sine, cosine);
    const Vec3d n = cylinder.axes[0] * cosine + cylinder.axes[1] * sine;
    out.p = Vec3(cylinder.base + n * cylinder.radius + cylinder.axes[2] * (cylinder.length * y));
    out.ng = Vec3(cylinder.inside_out ? -n : n);
    out.error = cylinder_error(cylinder, out.p, out.ng);
  } else if (rectangle_) {
    out.p = Vec3(Vec3d(rectangle_->corner) + Vec3d(rectangle_->edge_u) * x + Vec3d(rectangle_->edge_v) * y);
    out.ng = rectangle_->normal;
    out.error = corner_error_;
  } else {
    double rest = 0;
    const std::uint32_t index = record_.first_triangle + triangles_.sample(y, &rest);
    const Triangle& t = geometry_->triangles[index];
    const Vec2 b = warp::uniform_triangle({s.x, within(rest)});
    const Vec3d v0(t.v0);
    out.p = Vec3(v0 + (Vec3d(t.v1) - v0) * static_cast<double>(b.x) +
                 (Vec3d(t.v2) - v0) * static_cast<double>(b.y));
    out.ng = t.ng;
    out.error = geometry_->point_error(index, out.p);
  }
  return out;
}

Vec2 IrradianceMeter::square_place(const SurfaceHit& on) const {
  const Vec3d p(on.p);
  if (record_.sphere != kNone) {
    const Sphere& sphere = geometry_->spheres[record_.sphere].sphere;
    const Vec3d n = normalize(p - sphere.center);
    return {sphere_uv(sphere, n).x, within(0.5 - 0.5 * dot(n, sphere.axes[2]))};
  }
  if (record_.disk != kNone) {
    const Vec2 uv = disk_uv(geometry_->disks[record_.disk].disk, p);
    return {within(static_cast<double>(uv.x) * static_cast<double>(uv.x)), uv.y};
  }
  if (record_.cylinder != kNone) return cylinder_uv(geometry_->cylinders[record_.cylinder].cylinder, p);
  if (rectangle_) {
    const Vec3d d = p - Vec3d(rectangle_->corner), u(rectangle_->edge_u), v(rectangle_->edge_v);
    const Vec3d n = cross(u, v);
    const double scale = 1 / length_squared(n);
    return {within(dot(cross(d, v), n) * scale), within(dot(cross(u, d), n) * scale)};
  }
  // The inverse of warp::uniform_triangle.
  const Vec2 b = on.barycentric;
  const Vec2 in_triangle = b.x < b.y ? Vec2{2 * b.x, b.x + b.y} : Vec2{b.x + b.y, 2 * b.y};
  return {
      within(static_cast<double>(in_triangle.x)),
      within(triangles_.place(on.primitive - record_.first_triangle, static_cast<double>(in_triangle.y)))};
}

Ray IrradianceMeter::ray(float film_x, float film_y, Vec2 u_lens) const {
  const Place from =
      place({within(static_cast<double>(film_x / width_)), within(static_cast<double>(film_y / height_))});
  SurfaceHit hit;
  hit.p = from.p;
  hit.ng = from.ng;
  hit.error = from.error;
  return spawn_ray(hit, normalize(make_frame(from.ng).to_world(warp::cosine_hemisphere(u_lens))));
}

void IrradianceMeter::fill(Vec3 p, Vec2 s, float cosine, CameraDensity& out) const {
  out.p = p;
  out.film_x = s.x * width_;
  out.film_y = s.y * height_;
  out.delta_position = out.delta_direction = false;
  out.pdf_area = static_cast<float>(1 / area_);
  out.pdf_solid_angle = warp::pdf_cosine_hemisphere_solid_angle(cosine);
  out.importance = importance();
  out.cosine = cosine;
}

bool IrradianceMeter::sample(const SurfaceHit& reference, Vec2 u_lens, CameraSample& out) const {
  const Place at = place(u_lens);
  const Vec3d v = Vec3d(at.p) - Vec3d(reference.p);
  const double distance_squared = length_squared(v), distance = std::sqrt(distance_squared);
  const double cosine = -dot(v, Vec3d(at.ng)) / distance;
  if (!(cosine > 0)) return false;
  out.wi = Vec3(v / distance);
  out.p = at.p;
  out.ng = at.ng;
  out.film_x = u_lens.x * width_;
  out.film_y = u_lens.y * height_;
  out.importance = importance();
  out.pdf_solid_angle = static_cast<float>(area_to_solid_angle(1.0, distance_squared, cosine * area_));
  out.cosine = static_cast<float>(cosine);
  out.delta_position = out.delta_direction = false;
  out.shadow_ray = spawn_shadow_ray(reference, at.p, at.ng, at.error);
  return std::isfinite(out.pdf_solid_angle) && out.pdf_solid_angle > 0;
}

bool IrradianceMeter::density(const SurfaceHit& on, Vec3 direction, CameraDensity& out) const {
  const float cosine = dot(direction, on.ng);
  if (!(cosine > 0)) return false;
  fill(on.p, square_place(on), cosine, out);
  return true;
}

void IrradianceMeter::density(const CameraSample& sampled, CameraDensity& out) const {
  fill(sampled.p, {sampled.film_x / width_, sampled.film_y / height_}, sampled.cosine, out);
}

SurfaceHit IrradianceMeter::start_of(const Ray& ray, const SurfaceHit* backwards) const {
  if (backwards != nullptr && backwards->shape == shape_) return *backwards;
  SurfaceHit hit;
  hit.p = ray.origin;
  hit.shape = shape_;
  const Vec3d p(ray.origin);
  if (record_.sphere != kNone) {
    const Sphere& sphere = geometry_->spheres[record_.sphere].sphere;
    const Vec3d n = normalize(p - sphere.center);
    hit.ng = Vec3(sphere.inside_out ? -n : n);
  } else if (record_.disk != kNone) {
    hit.ng = Vec3(geometry_->disks[record_.disk].disk.axes[2]);
  } else if (record_.cylinder != kNone) {
    const Cylinder& cylinder = geometry_->cylinders[record_.cylinder].cylinder;
    const Vec3d d = p - cylinder.base;
    const Vec3d n = normalize(d - cylinder.axes[2] * dot(d, cylinder.axes[2]));
    hit.ng = Vec3(cylinder.inside_out ? -n : n);
  } else if (rectangle_) {
    hit.ng = rectangle_->normal;
  } else {
    nearest_triangle(p, hit);
  }
  return hit;
}

// Rarely called: a ray that leaves a mesh near its rim may miss it backwards.
void IrradianceMeter::nearest_triangle(Vec3d p, SurfaceHit& hit) const {
  double nearest = std::numeric_limits<double>::infinity();
  for (std::uint32_t i = 0; i < record_.triangle_count; ++i) {
    const std::uint32_t index = record_.first_triangle + i;
    const Triangle& t = geometry_->triangles[index];
    const Vec3d v0(t.v0), e1 = Vec3d(t.v1) - v0, e2 = Vec3d(t.v2) - v0, d = p - v0, n = cross(e1, e2);
    const double scale = 1 / length_squared(n);
    double b1 = std::clamp(dot(cross(d, e2), n) * scale, 0.0, 1.0);
    double b2 = std::clamp(dot(cross(e1, d), n) * scale, 0.0, 1.0);
    if (const double sum = b1 + b2; sum > 1) {
      b1 /= sum;
      b2 /= sum;
    }
    const double distance = length_squared(d - e1 * b1 - e2 * b2);
    if (!(distance < nearest)) continue;
    nearest = distance;
    hit.ng = t.ng;
    hit.primitive = index;
    hit.barycentric = {static_cast<float>(b1), static_cast<float>(b2)};
  }
}

}  // namespace candela::scene
