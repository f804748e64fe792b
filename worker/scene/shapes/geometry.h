// All shapes of a scene joined into flat arrays: what Embree is built from, and what a hit is computed from.
#pragma once

#include <cstdint>
#include <vector>

#include "worker/core/vec.h"
#include "worker/scene/hit.h"
#include "worker/scene/shapes/shape.h"

namespace candela::scene {

// All that a hit on a flat, untextured triangle needs, in one cache line.
struct alignas(64) Triangle {
  Vec3 v0, v1, v2;
  Vec3 ng;  // unit
  std::uint32_t shape = 0;
  float plane_error = 0;  // how far from its plane a point must start for Embree not to meet it again
  bool smooth = false;    // has shading normals
  bool mapped = false;    // has texture coordinates that somebody reads
};

struct ShapeRecord {
  std::uint32_t bsdf = kNone;
  std::uint32_t emitter = kNone;
  std::uint32_t first_triangle = 0, triangle_count = 0;  // in Geometry::triangles
  std::uint32_t sphere = kNone;                          // in Geometry::spheres
  bool reads_uv = false;  // a texture or an anisotropic bsdf depends on the parameterisation
};

struct SphereRecord {
  Sphere sphere;
  std::uint32_t shape = 0;
};

struct Bounds {
  Vec3d low{1e300, 1e300, 1e300}, high{-1e300, -1e300, -1e300};
  bool empty() const { return !(low.x <= high.x); }
  void add(Vec3d p) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  Vec3d center() const { return empty() ? Vec3d{} : (low + high) * 0.5; }
  double radius() const { return empty() ? 0.0 : length(high - low) * 0.5; }
};

struct Geometry {
  std::vector<Vec3> positions;  // with one element more than used: Embree reads 16 bytes at each
  std::vector<Vec3> normals;    // as positions; empty where no shape is smooth
  std::vector<Vec2> uvs;        // as positions; empty where nobody reads them
  std::vector<std::array<std::uint32_t, 3>> indices;
  std::vector<Triangle> triangles;  // parallel to indices
  std::vector<SphereRecord> spheres;
  std::vector<ShapeRecord> shapes;
  Bounds bounds;

  // Appends; record's primitives are filled in.
  void add(Shape shape, ShapeRecord record);
  void finish();

  // The hit of `ray` on a primitive Embree reported, by our own arithmetic: the bits follow from ray and
  // primitive alone.
  void triangle_hit(const Ray& ray, std::uint32_t triangle, SurfaceHit& hit) const;
  void sphere_hit(const Ray& ray, std::uint32_t sphere, SurfaceHit& hit) const;

  // For points sampled on a triangle: texture coordinates (barycentric ones where it has none), and the error
  // bound of SurfaceHit.
  Vec2 uv_at(std::uint32_t triangle, float b1, float b2) const;
  float point_error(std::uint32_t triangle, Vec3 p) const;
};

// Mitsuba's parameterisation, of the point in direction n (unit) from the centre.
Vec2 sphere_uv(const Sphere& sphere, Vec3d n);

// Distances along the ray (unit direction, in double) where it meets the sphere; false: it does not.
bool sphere_distances(const Sphere& sphere, Vec3d origin, Vec3d direction, double& near, double& far);

}  // namespace candela::scene
