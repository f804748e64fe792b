#include "worker/scene/emitters/mesh.h"

#include <algorithm>
#include <vector>

#include "worker/core/warp.h"

namespace candela::scene {

MeshSurface::MeshSurface(const Geometry& geometry, std::uint32_t shape)
    : geometry_(&geometry), first_(geometry.shapes[shape].first_triangle) {
  std::vector<double> areas(geometry.shapes[shape].triangle_count);
  for (std::size_t i = 0; i < areas.size(); ++i) {
    const Triangle& t = geometry.triangles[first_ + i];
    areas[i] = 0.5 * length(cross(Vec3d(t.v1) - Vec3d(t.v0), Vec3d(t.v2) - Vec3d(t.v0)));
  }
  triangles_ = Distribution(areas);
}

void MeshSurface::sample_area(double u_triangle, Vec2 u, LightPoint& out) const {
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

bool MeshSurface::sample(Vec3 reference, double u_triangle, Vec2 u, LightPoint& out) const {
  sample_area(u_triangle, u, out);
  return finish_by_area(reference, triangles_.total(), out);
}

float MeshSurface::pdf_solid_angle(Vec3 reference, const SurfaceHit& hit) const {
  return pdf_of_area_solid_angle(reference, hit.p, hit.ng, triangles_.total());
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
