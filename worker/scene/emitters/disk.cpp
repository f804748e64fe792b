#include "worker/scene/emitters/disk.h"

#include <numbers>

namespace candela::scene {

void DiskSurface::sample_area(double /*rest*/, Vec2 u, LightPoint& out) const {
  const Vec2 d = warp::concentric_disk(u);
  out.p = Vec3(disk_.center + disk_.axes[0] * (disk_.radius * static_cast<double>(d.x)) +
               disk_.axes[1] * (disk_.radius * static_cast<double>(d.y)));
  out.ng = Vec3(disk_.axes[2]);
  out.error = disk_error(disk_, out.p);
}

double DiskSurface::area() const {
  return std::numbers::pi * disk_.radius * disk_.radius;
}

bool DiskSurface::sample(Vec3 reference, double rest, Vec2 u, LightPoint& out) const {
  if (!reaches(reference)) return false;
  sample_area(rest, u, out);
  return finish_by_area(reference, area(), out);
}

float DiskSurface::pdf_solid_angle(Vec3 reference, const SurfaceHit& hit) const {
  return reaches(reference) ? pdf_of_area_solid_angle(reference, hit.p, Vec3(disk_.axes[2]), area()) : 0.0f;
}

void DiskSurface::find_uv(LightPoint& point) const {
  point.uv = disk_uv(disk_, Vec3d(point.p));
}

SurfaceExtent DiskSurface::extent() const {
  SurfaceExtent e;
  e.center = Vec3(disk_.center);
  e.radius = static_cast<float>(disk_.radius);
  e.axis = Vec3(disk_.axes[2]);
  e.cos_spread = 1;
  return e;
}

template class AreaLight<DiskSurface>;

}  // namespace candela::scene
