#include "worker/scene/emitters/mesh.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "worker/core/warp.h"
#include "worker/scene/emitters/points/spherical_triangle.h"

namespace candela::scene {
namespace {

// The triangle as the reference sees it; its solid angle is 0 from behind.
SphericalTriangle triangle_from(const Triangle& t, Vec3 reference) {
  const Vec3d p(reference), a = Vec3d(t.v0) - p, b = Vec3d(t.v1) - p, c = Vec3d(t.v2) - p;
  const double volume = dot(a, cross(Vec3d(t.v1) - Vec3d(t.v0), Vec3d(t.v2) - Vec3d(t.v0)));
  return {a, b, c, -dot(a, Vec3d(t.ng)) > 0 ? std::abs(volume) : 0.0};
}

}  // namespace

Distribution triangles_by_area(const Geometry& geometry, std::uint32_t shape) {
  std::vector<double> areas(geometry.shapes[shape].triangle_count);
  for (std::size_t i = 0; i < areas.size(); ++i) {
    const Triangle& t = geometry.triangles[geometry.shapes[shape].first_triangle + i];
    areas[i] = 0.5 * length(cross(Vec3d(t.v1) - Vec3d(t.v0), Vec3d(t.v2) - Vec3d(t.v0)));
  }
  return Distribution(areas);
}

MeshSurface::MeshSurface(const Geometry& geometry, std::uint32_t shape)
    : geometry_(&geometry),
      first_(geometry.shapes[shape].first_triangle),
      triangles_(triangles_by_area(geometry, shape)) {}

void MeshSurface::sample_area(double u_triangle, Vec2 u, LightPoint& out) const {
  const std::uint32_t index = first_ + triangles_.sample(u_triangle);
  const Triangle& t = geometry_->triangles[index];
  const Vec2 b = warp::uniform_triangle(u);
  const Vec3d v0(t.v0);
  const Vec3d p =
      v0 + (Vec3d(t.v1) - v0) * static_cast<double>(b.x) + (Vec3d(t.v2) - v0) * static_cast<double>(b.y);
  place(index, Vec3(p), b, out);
}

void MeshSurface::place(std::uint32_t triangle, Vec3 p, Vec2 barycentric, LightPoint& out) const {
  out.p = p;
  out.ng = geometry_->triangles[triangle].ng;
  out.uv = geometry_->uv_at(triangle, barycentric.x, barycentric.y);
  out.barycentric = barycentric;
  out.error = geometry_->point_error(triangle, p);
  out.primitive = triangle;
}

bool MeshSurface::sample(Vec3 reference, double u_triangle, Vec2 u, LightPoint& out) const {
  sample_area(u_triangle, u, out);
  return finish_by_area(reference, triangles_.total(), out);
}

float MeshSurface::pdf_solid_angle(Vec3 reference, const SurfaceHit& hit) const {
  return pdf_of_area_solid_angle(reference, hit.p, hit.ng, triangles_.total());
}

bool MeshSurface::sample_by(PointSampler sampler, Vec3 reference, Vec3 /*front*/, double u_triangle, Vec2 u,
                            LightPoint& out) const {
  if (sampler != PointSampler::spherical) return sample(reference, u_triangle, u, out);
  const std::uint32_t chosen = triangles_.sample(u_triangle), index = first_ + chosen;
  const Triangle& t = geometry_->triangles[index];
  const SphericalTriangle seen = triangle_from(t, reference);
  const double pdf = triangles_.probability(chosen) / seen.solid_angle();
  if (!usable_density(pdf)) return false;  // seen from behind or edge-on
  const TVec2<double> b = seen.sample(static_cast<double>(u.x), static_cast<double>(u.y));
  const Vec3d v0(t.v0), p = v0 + (Vec3d(t.v1) - v0) * b.x + (Vec3d(t.v2) - v0) * b.y;
  place(index, Vec3(p), {static_cast<float>(b.x), static_cast<float>(b.y)}, out);
  out.wi = Vec3(normalize(p - Vec3d(reference)));  // not zero: the reference is off the plane
  out.pdf_solid_angle = static_cast<float>(pdf);
  return true;
}

float MeshSurface::pdf_by_solid_angle(PointSampler sampler, Vec3 reference, Vec3 /*front*/,
                                      const SurfaceHit& hit) const {
  if (sampler != PointSampler::spherical) return pdf_solid_angle(reference, hit);
  const Triangle& t = geometry_->triangles[hit.primitive];
  const double pdf =
      triangles_.probability(hit.primitive - first_) / triangle_from(t, reference).solid_angle();
  return usable_density(pdf) ? static_cast<float>(pdf) : 0.0f;
}

SurfaceExtent extent_of_triangles(const Geometry& geometry, std::uint32_t shape) {
  const ShapeRecord& record = geometry.shapes[shape];
  const auto end = record.first_triangle + record.triangle_count;
  SurfaceExtent e;
  Bounds bounds;
  Vec3d sum;
  for (std::uint32_t i = record.first_triangle; i < end; ++i) {
    const Triangle& t = geometry.triangles[i];
    for (const Vec3 v : {t.v0, t.v1, t.v2}) bounds.add(Vec3d(v));
    sum += cross(Vec3d(t.v1) - Vec3d(t.v0), Vec3d(t.v2) - Vec3d(t.v0));
  }
  e.center = Vec3(bounds.center());
  e.radius = static_cast<float>(bounds.radius());
  const double l = length(sum);
  e.axis = l > 0 ? Vec3(sum / l) : Vec3(0, 0, 1);
  float least = 1;
  for (std::uint32_t i = record.first_triangle; i < end; ++i) {
    least = std::min(least, dot(e.axis, geometry.triangles[i].ng));
  }
  e.cos_spread = l > 0 ? std::clamp(least, -1.0f, 1.0f) : -1.0f;
  e.sin_spread = sine(e.cos_spread);
  return e;
}

float corner_error(const Geometry& geometry, std::uint32_t shape) {
  const ShapeRecord& record = geometry.shapes[shape];
  float error = 0;
  for (std::uint32_t i = record.first_triangle; i < record.first_triangle + record.triangle_count; ++i) {
    const Triangle& t = geometry.triangles[i];
    for (const Vec3 v : {t.v0, t.v1, t.v2}) error = std::max(error, geometry.point_error(i, v));
  }
  return error;
}

template class AreaLight<MeshSurface>;

}  // namespace candela::scene
