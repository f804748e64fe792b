#include "worker/scene/emitters/sphere.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace candela::scene {

double SphereSurface::one_minus_cos(double distance_squared) const {
  const double sine_squared = std::min(1.0, sphere_.radius * sphere_.radius / distance_squared);
  return sine_squared / (1 + std::sqrt(1 - sine_squared));
}

bool SphereSurface::sample(Vec3 reference, double /*rest*/, Vec2 u, LightPoint& out) const {
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

float SphereSurface::pdf_solid_angle(Vec3 reference, const SurfaceHit& /*hit*/) const {
  if (!reaches(reference)) return 0;
  if (sphere_.inside_out) return warp::kPdfUniformSphereSolidAngle;
  const double cap = one_minus_cos(length_squared(sphere_.center - Vec3d(reference)));
  return static_cast<float>(1 / (2 * std::numbers::pi * cap));
}

void SphereSurface::sample_area(double /*rest*/, Vec2 u, LightPoint& out) const {
  const Vec3d n = normalize(Vec3d(warp::uniform_sphere(u)));
  out.p = Vec3(sphere_.center + n * sphere_.radius);
  out.ng = Vec3(sphere_.inside_out ? -n : n);
  out.error = sphere_error(sphere_, out.p, out.ng);
}

double SphereSurface::area() const {
  return 4 * std::numbers::pi * sphere_.radius * sphere_.radius;
}

void SphereSurface::find_uv(LightPoint& point) const {
  const Vec3d n(point.ng);
  point.uv = sphere_uv(sphere_, sphere_.inside_out ? -n : n);
}

SurfaceExtent SphereSurface::extent() const {
  SurfaceExtent e;
  e.center = Vec3(sphere_.center);
  e.radius = static_cast<float>(sphere_.radius);
  return e;
}

template class AreaLight<SphereSurface>;

}  // namespace candela::scene
