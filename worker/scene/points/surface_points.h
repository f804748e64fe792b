// Canonical points of a scene: found by rays, and from them all that is at a surface there, in double, or as
// Scene::intersect() gives it.
#pragma once

#include <optional>
#include <vector>

#include "worker/scene/accel.h"
#include "worker/scene/hit.h"
#include "worker/scene/points/canonical_point.h"
#include "worker/scene/shapes/geometry.h"

namespace candela::scene {

class SurfacePoints {
 public:
  // Both must outlive this. turned: by bsdf, whether a bump or normal map turns its shading normal.
  SurfacePoints(const Geometry& geometry, const Accel& accel, std::vector<bool> turned)
      : geometry_(geometry), accel_(accel), turned_(std::move(turned)) {}

  // The first surface along `ray`, at the point where the line origin + t direction meets it. Both are the
  // same ray: `ray` is rounded, and starts off the surface that it leaves. Nothing: the ray leaves the scene.
  std::optional<CanonicalPoint> intersect(const Ray& ray, Vec3d origin, Vec3d direction) const;
  // The same of one ray.
  std::optional<CanonicalPoint> intersect(const Ray& ray) const {
    return intersect(ray, Vec3d(ray.origin), Vec3d(ray.direction));
  }

  // The point of a hit, as near as it says. Nothing: no instance of its shape is there.
  std::optional<CanonicalPoint> of(const SurfaceHit& hit) const;

  SurfaceGeometry at(const CanonicalPoint& point) const;
  // Hit of a ray that meets the point. Its distance is 0.
  SurfaceHit hit(const CanonicalPoint& point) const;

  // True if the scene has such a point, which was read from bytes.
  bool exists(const CanonicalPoint& point) const;

 private:
  const Geometry& geometry_;
  const Accel& accel_;
  std::vector<bool> turned_;
};

}  // namespace candela::scene
