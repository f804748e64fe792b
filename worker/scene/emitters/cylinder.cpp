#include "worker/scene/emitters/cylinder.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "worker/scene/emitters/double_math.h"

namespace candela::scene {

bool CylinderSurface::across(Vec3 reference, double& x, double& y, double& half) const {
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

bool CylinderSurface::reaches(Vec3 reference) const {
  double x = 0, y = 0, half = 0;
  return across(reference, x, y, half);
}

bool CylinderSurface::sample(Vec3 reference, double /*rest*/, Vec2 u, LightPoint& out) const {
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
float CylinderSurface::pdf_solid_angle(Vec3 reference, const SurfaceHit& hit) const {
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

void CylinderSurface::sample_area(double /*rest*/, Vec2 u, LightPoint& out) const {
  double sine = 0, cosine = 0;
  sincos_double(2 * std::numbers::pi * static_cast<double>(u.x), sine, cosine);
  const Vec3d n = cylinder_.axes[0] * cosine + cylinder_.axes[1] * sine;
  out.p = Vec3(cylinder_.base + n * cylinder_.radius +
               cylinder_.axes[2] * (cylinder_.length * static_cast<double>(u.y)));
  out.ng = Vec3(cylinder_.inside_out ? -n : n);
  out.error = cylinder_error(cylinder_, out.p, out.ng);
}

double CylinderSurface::area() const {
  return 2 * std::numbers::pi * cylinder_.radius * cylinder_.length;
}

void CylinderSurface::find_uv(LightPoint& point) const {
  point.uv = cylinder_uv(cylinder_, Vec3d(point.p));
}

SurfaceExtent CylinderSurface::extent() const {
  const Cylinder& c = cylinder_;
  SurfaceExtent e;
  e.center = Vec3(c.base + c.axes[2] * (c.length / 2));
  e.radius = static_cast<float>(std::sqrt(c.radius * c.radius + c.length * c.length / 4));
  return e;
}

template class AreaLight<CylinderSurface>;

}  // namespace candela::scene
