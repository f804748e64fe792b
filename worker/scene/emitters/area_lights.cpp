#include "worker/scene/emitters/area_lights.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "worker/core/math.h"
#include "worker/core/warp.h"

namespace candela::scene {
namespace {

// Double elementary functions from the pieces the float ones are made of (relative error below 1e-12).
double asin_double(double x) {
  const double a = std::min(std::abs(x), 1.0);
  const double r = a <= 0.5 ? math::detail::asin_half(a)
                            : std::numbers::pi / 2 - 2 * math::detail::asin_half(std::sqrt((1 - a) / 2));
  return std::copysign(r, x);
}
void sincos_double(double x, double& sine, double& cosine) {
  std::uint64_t quadrant = 0;
  const double r = math::detail::reduce_quadrant(x, quadrant);
  const double s = math::detail::sin_kernel(r), c = math::detail::cos_kernel(r);
  const double a = (quadrant & 1) != 0 ? c : s, b = (quadrant & 1) != 0 ? s : c;
  sine = (quadrant & 2) != 0 ? -a : a;
  cosine = ((quadrant + 1) & 2) != 0 ? -b : b;
}

// Density per area to density per solid angle; zero where the point is seen from behind or edge-on.
float per_solid_angle(Vec3 reference, Vec3 p, Vec3 ng, double area) {
  const Vec3d v = Vec3d(reference) - Vec3d(p);
  const double distance_squared = length_squared(v);
  const double cosine_times_distance = dot(v, Vec3d(ng));
  if (!(cosine_times_distance > 0)) return 0;
  return static_cast<float>(distance_squared * std::sqrt(distance_squared) / (cosine_times_distance * area));
}

// Direction and density of a point sampled uniformly in area, by one square root.
bool finish_by_area(Vec3 reference, double area, LightPoint& out) {
  const Vec3d v = Vec3d(out.p) - Vec3d(reference);
  const double distance_squared = length_squared(v), distance = std::sqrt(distance_squared);
  const double cosine_times_distance = -dot(v, Vec3d(out.ng));
  if (!(cosine_times_distance > 0)) return false;
  out.wi = Vec3(v / distance);
  out.pdf_solid_angle = static_cast<float>(distance_squared * distance / (cosine_times_distance * area));
  return out.pdf_solid_angle > 0 && out.pdf_solid_angle < std::numeric_limits<float>::infinity();
}

}  // namespace

// ---- rectangles
// ----------------------------------------------------------------------------------------------

RectangleLight::RectangleLight(const Rectangle& rectangle, float error)
    : rectangle_(rectangle), error_(error) {
  const Vec3d u(rectangle.edge_u), v(rectangle.edge_v);
  length_u_ = length(u);
  length_v_ = length(v);
  axis_u_ = u / length_u_;
  axis_v_ = v / length_v_;
  area_ = length(cross(u, v));
  center_ = rectangle.corner + (rectangle.edge_u + rectangle.edge_v) * 0.5f;
  const double diagonal_squared = length_u_ * length_u_ + length_v_ * length_v_;
  // Edges written as decimal text are perpendicular to some 1e-6.
  const bool right_angled = std::abs(dot(axis_u_, axis_v_)) < 1e-5;
  near_squared_ =
      right_angled ? static_cast<float>(diagonal_squared) * kNearDiagonals * kNearDiagonals : 0.0f;
}

bool RectangleLight::spherical(Vec3 reference, Spherical& s) const {
  if (!(length_squared(reference - center_) < near_squared_)) return false;
  const Vec3d d = Vec3d(rectangle_.corner) - Vec3d(reference);
  s.z0 = dot(d, Vec3d(rectangle_.normal));
  // In its plane the parametrisation degenerates; area sampling does not mind.
  if (!(s.z0 < -1e-4 * std::max(length_u_, length_v_))) return false;
  s.x0 = dot(d, axis_u_);
  s.y0 = dot(d, axis_v_);
  s.x1 = s.x0 + length_u_;
  s.y1 = s.y0 + length_v_;
  // z components of the normals of the planes through the reference and each edge. The angles of the
  // spherical rectangle are acos(-n_i n_{i+1}) = pi/2 + asin(n_i n_{i+1}), whose sum less 2 pi is the solid
  // angle without cancellation of the pi/2. [Urena 2013, Sec. 3]
  const double zz = s.z0 * s.z0;
  const double n0 = -s.y0 / std::sqrt(zz + s.y0 * s.y0), n1 = s.x1 / std::sqrt(zz + s.x1 * s.x1);
  const double n2 = s.y1 / std::sqrt(zz + s.y1 * s.y1), n3 = -s.x0 / std::sqrt(zz + s.x0 * s.x0);
  const double a2 = asin_double(n2 * n3), a3 = asin_double(n3 * n0);
  s.solid_angle = asin_double(n0 * n1) + asin_double(n1 * n2) + a2 + a3;
  s.b0 = n0;
  s.b1 = n2;
  s.k = std::numbers::pi - a2 - a3;
  return s.solid_angle > 1e-4;
}

bool RectangleLight::sample(Vec3 reference, Vec2 u, LightPoint& out) const {
  if (!reaches(reference)) return false;
  double along_u = static_cast<double>(u.x), along_v = static_cast<double>(u.y);
  Spherical s;
  const bool by_solid_angle = spherical(reference, s);
  if (by_solid_angle) {
    // [Urena 2013, Sec. 4]
    double sine = 0, cosine = 0;
    sincos_double(along_u * s.solid_angle + s.k, sine, cosine);
    const double fu = (cosine * s.b0 - s.b1) / sine;
    const double cu = std::clamp(std::copysign(1.0, fu) / std::sqrt(fu * fu + s.b0 * s.b0), -1.0, 1.0);
    double x = -(cu * s.z0) / std::sqrt(std::max(1 - cu * cu, 1e-300));
    if (!(x >= s.x0)) x = s.x0;
    x = std::min(x, s.x1);
    const double d2 = x * x + s.z0 * s.z0;
    const double h0 = s.y0 / std::sqrt(d2 + s.y0 * s.y0), h1 = s.y1 / std::sqrt(d2 + s.y1 * s.y1);
    const double h = h0 + along_v * (h1 - h0), h2 = h * h;
    const double y = h2 < 1 - 1e-14 ? h * std::sqrt(d2) / std::sqrt(1 - h2) : s.y1;
    along_u = std::clamp((x - s.x0) / length_u_, 0.0, 1.0);
    along_v = std::clamp((y - s.y0) / length_v_, 0.0, 1.0);
  }
  out.p = Vec3(Vec3d(rectangle_.corner) + Vec3d(rectangle_.edge_u) * along_u +
               Vec3d(rectangle_.edge_v) * along_v);
  out.ng = rectangle_.normal;
  out.uv = {static_cast<float>(along_u), static_cast<float>(along_v)};
  out.error = error_;
  if (!by_solid_angle) return finish_by_area(reference, area_, out);
  const Vec3d v = Vec3d(out.p) - Vec3d(reference);
  out.wi = Vec3(normalize(v));  // not zero: the reference is off the plane
  out.pdf_solid_angle = static_cast<float>(1 / s.solid_angle);
  return true;
}

void RectangleLight::sample_area(Vec2 u, LightPoint& out) const {
  out.p = Vec3(Vec3d(rectangle_.corner) + Vec3d(rectangle_.edge_u) * static_cast<double>(u.x) +
               Vec3d(rectangle_.edge_v) * static_cast<double>(u.y));
  out.ng = rectangle_.normal;
  out.uv = u;
  out.error = error_;
}

float RectangleLight::pdf_solid_angle(Vec3 reference, Vec3 p) const {
  if (!reaches(reference)) return 0;
  Spherical s;
  if (spherical(reference, s)) return static_cast<float>(1 / s.solid_angle);
  return per_solid_angle(reference, p, rectangle_.normal, area_);
}

// ---- spheres
// -------------------------------------------------------------------------------------------------

double SphereLight::one_minus_cos(double distance_squared) const {
  const double sine_squared = std::min(1.0, sphere_.radius * sphere_.radius / distance_squared);
  return sine_squared / (1 + std::sqrt(1 - sine_squared));
}

bool SphereLight::sample(Vec3 reference, Vec2 u, LightPoint& out) const {
  if (!reaches(reference)) return false;
  const Vec3d to_center = sphere_.center - Vec3d(reference);
  const double distance_squared = length_squared(to_center);
  double n_scale = 1;
  if (sphere_.inside_out) {
    out.wi = warp::uniform_sphere(u);
    out.pdf_solid_angle = warp::kPdfUniformSphereSolidAngle;
    n_scale = -1;
  } else {
    const double cap = one_minus_cos(distance_squared);
    const Frame frame = make_frame(Vec3(to_center / std::sqrt(distance_squared)));
    out.wi = frame.to_world(warp::uniform_cone(u, static_cast<float>(cap)));
    out.pdf_solid_angle = static_cast<float>(1 / (2 * std::numbers::pi * cap));
  }
  // The meeting of the direction with the sphere; at the rim rounding may miss it, and its nearest point
  // serves.
  const Vec3d wi = normalize(Vec3d(out.wi));
  const double along = dot(to_center, wi);
  const Vec3d miss = wi * along - to_center;
  const double half = std::sqrt(std::max(0.0, sphere_.radius * sphere_.radius - length_squared(miss)));
  const double t = sphere_.inside_out ? along + half : along - half;
  Vec3d n = wi * t - to_center;
  const double l = length(n);
  if (!(l > 0)) return false;
  n = n / l;
  out.p = Vec3(sphere_.center + n * sphere_.radius);
  out.ng = Vec3(n * n_scale);
  out.error = 0x1p-22f * (std::abs(out.p.x) + std::abs(out.p.y) + std::abs(out.p.z)) +
              static_cast<float>(sphere_.radius) * 0x1p-22f;
  return out.pdf_solid_angle < std::numeric_limits<float>::infinity();
}

float SphereLight::pdf_solid_angle(Vec3 reference) const {
  if (!reaches(reference)) return 0;
  if (sphere_.inside_out) return warp::kPdfUniformSphereSolidAngle;
  const double cap = one_minus_cos(length_squared(sphere_.center - Vec3d(reference)));
  return static_cast<float>(1 / (2 * std::numbers::pi * cap));
}

void SphereLight::sample_area(Vec2 u, LightPoint& out) const {
  const Vec3d n = normalize(Vec3d(warp::uniform_sphere(u)));
  out.p = Vec3(sphere_.center + n * sphere_.radius);
  out.ng = Vec3(sphere_.inside_out ? -n : n);
  out.error = sphere_error(sphere_, out.p, out.ng);
}

double SphereLight::area() const {
  return 4 * std::numbers::pi * sphere_.radius * sphere_.radius;
}

// ---- disks
// ---------------------------------------------------------------------------------------------------

void DiskLight::sample_area(Vec2 u, LightPoint& out) const {
  const Vec2 d = warp::concentric_disk(u);
  out.p = Vec3(disk_.center + disk_.axes[0] * (disk_.radius * static_cast<double>(d.x)) +
               disk_.axes[1] * (disk_.radius * static_cast<double>(d.y)));
  out.ng = Vec3(disk_.axes[2]);
  out.error = disk_error(disk_, out.p);
}

double DiskLight::area() const {
  return std::numbers::pi * disk_.radius * disk_.radius;
}

bool DiskLight::sample(Vec3 reference, Vec2 u, LightPoint& out) const {
  if (!reaches(reference)) return false;
  sample_area(u, out);
  return finish_by_area(reference, area(), out);
}

float DiskLight::pdf_solid_angle(Vec3 reference, Vec3 p) const {
  return reaches(reference) ? per_solid_angle(reference, p, Vec3(disk_.axes[2]), area()) : 0.0f;
}

// ---- cylinders
// -----------------------------------------------------------------------------------------------

bool CylinderLight::across(Vec3 reference, double& x, double& y, double& half) const {
  const Vec3d v = Vec3d(reference) - cylinder_.base;
  x = dot(v, cylinder_.axes[0]);
  y = dot(v, cylinder_.axes[1]);
  const double distance = std::sqrt(x * x + y * y);
  if (distance > cylinder_.radius) {
    half = asin_double(cylinder_.radius / distance);
    return half > 0;
  }
  half = std::numbers::pi;
  return cylinder_.inside_out;
}

bool CylinderLight::reaches(Vec3 reference) const {
  double x = 0, y = 0, half = 0;
  return across(reference, x, y, half);
}

bool CylinderLight::sample(Vec3 reference, Vec2 u, LightPoint& out) const {
  double x = 0, y = 0, half = 0;
  if (!across(reference, x, y, half)) return false;
  double sine = 0, cosine = 0;
  sincos_double((2 * static_cast<double>(u.x) - 1) * half, sine, cosine);
  // Turned by that from the direction to the axis; any direction where the reference is on it.
  const double distance = std::sqrt(x * x + y * y);
  const double to_x = distance > 0 ? -x / distance : 1, to_y = distance > 0 ? -y / distance : 0;
  const double dx = to_x * cosine - to_y * sine, dy = to_x * sine + to_y * cosine;
  const double middle = distance * cosine, miss = distance * sine;
  const double chord = std::sqrt(std::max(0.0, cylinder_.radius * cylinder_.radius - miss * miss));
  // The outer side is met first, the inner one last.
  const double t = cylinder_.inside_out ? middle + chord : middle - chord;
  const double px = x + dx * t, py = y + dy * t, l = std::sqrt(px * px + py * py);
  if (!(l > 0)) return false;
  const Vec3d n = cylinder_.axes[0] * (px / l) + cylinder_.axes[1] * (py / l);
  out.p = Vec3(cylinder_.base + n * cylinder_.radius +
               cylinder_.axes[2] * (cylinder_.length * static_cast<double>(u.y)));
  out.ng = Vec3(cylinder_.inside_out ? -n : n);
  out.error = cylinder_error(cylinder_, out.p, out.ng);
  SurfaceHit hit;
  hit.p = out.p;
  hit.ng = out.ng;
  out.wi = Vec3(normalize(Vec3d(out.p) - Vec3d(reference)));
  out.pdf_solid_angle = pdf_solid_angle(reference, hit);
  return out.pdf_solid_angle > 0;
}

// In the plane across the axis, an angle of b is an arc of b t / cos, so the density per area is
// cos / (2 half t length); per solid angle, with the cosines' ratio t / distance: distance^3 / (2 half t^2
// length).
float CylinderLight::pdf_solid_angle(Vec3 reference, const SurfaceHit& hit) const {
  double x = 0, y = 0, half = 0;
  if (!across(reference, x, y, half)) return 0;
  const Vec3d v = Vec3d(hit.p) - Vec3d(reference);
  if (!(dot(v, Vec3d(hit.ng)) < 0)) return 0;
  const double distance_squared = length_squared(v);
  const double along = dot(v, cylinder_.axes[2]);
  const double t_squared = distance_squared - along * along;
  const double pdf =
      distance_squared * std::sqrt(distance_squared) / (2 * half * t_squared * cylinder_.length);
  return pdf > 0 && pdf < 1e38 ? static_cast<float>(pdf) : 0.0f;
}

void CylinderLight::sample_area(Vec2 u, LightPoint& out) const {
  double sine = 0, cosine = 0;
  sincos_double(2 * std::numbers::pi * static_cast<double>(u.x), sine, cosine);
  const Vec3d n = cylinder_.axes[0] * cosine + cylinder_.axes[1] * sine;
  out.p = Vec3(cylinder_.base + n * cylinder_.radius +
               cylinder_.axes[2] * (cylinder_.length * static_cast<double>(u.y)));
  out.ng = Vec3(cylinder_.inside_out ? -n : n);
  out.error = cylinder_error(cylinder_, out.p, out.ng);
}

double CylinderLight::area() const {
  return 2 * std::numbers::pi * cylinder_.radius * cylinder_.length;
}

// ---- meshes
// --------------------------------------------------------------------------------------------------

MeshLight::MeshLight(const Geometry& geometry, std::uint32_t shape)
    : geometry_(&geometry), first_(geometry.shapes[shape].first_triangle) {
  std::vector<double> areas(geometry.shapes[shape].triangle_count);
  for (std::size_t i = 0; i < areas.size(); ++i) {
    const Triangle& t = geometry.triangles[first_ + i];
    areas[i] = 0.5 * length(cross(Vec3d(t.v1) - Vec3d(t.v0), Vec3d(t.v2) - Vec3d(t.v0)));
  }
  triangles_ = Distribution(areas);
}

void MeshLight::sample_area(double u_triangle, Vec2 u, LightPoint& out) const {
  const std::uint32_t index = first_ + triangles_.sample(u_triangle);
  const Triangle& t = geometry_->triangles[index];
  const Vec2 b = warp::uniform_triangle(u);
  const Vec3d v0(t.v0);
  out.p = Vec3(v0 + (Vec3d(t.v1) - v0) * static_cast<double>(b.x) +
               (Vec3d(t.v2) - v0) * static_cast<double>(b.y));
  out.ng = t.ng;
  out.uv = geometry_->uv_at(index, b.x, b.y);
  out.error = geometry_->point_error(index, out.p);
}

bool MeshLight::sample(Vec3 reference, double u_triangle, Vec2 u, LightPoint& out) const {
  sample_area(u_triangle, u, out);
  return finish_by_area(reference, triangles_.total(), out);
}

float MeshLight::pdf_solid_angle(Vec3 reference, const SurfaceHit& hit) const {
  return per_solid_angle(reference, hit.p, hit.ng, triangles_.total());
}

}  // namespace candela::scene
