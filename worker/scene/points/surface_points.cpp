#include "worker/scene/points/surface_points.h"

#include "worker/scene/points/surface_geometry.h"

namespace candela::scene {

std::optional<CanonicalPoint> SurfacePoints::intersect(const Ray& ray, Vec3d origin, Vec3d direction) const {
  Accel::Found found;
  if (!accel_.intersect(ray, found)) return std::nullopt;
  CanonicalPoint point;
  point.instance = found.instance;
  point.primitive = found.primitive;
  point.kind = static_cast<std::uint8_t>(found.kind);
  // Of two meetings with a round surface the one that Scene::intersect() takes.
  SurfaceHit rounded;
  if (found.instance == kNone)
    geometry_.hit(ray, found.kind, found.primitive, rounded);
  else
    geometry_.instance_hit(ray, found.instance, found.kind, found.primitive, rounded);
  set_meeting(geometry_, origin, direction, Vec3d(rounded.p), point);
  return point;
}

SurfaceGeometry SurfacePoints::at(const CanonicalPoint& point) const {
  SurfaceGeometry out = surface_geometry(geometry_, point);
  const std::uint32_t bsdf = geometry_.shapes[shape_of(geometry_, point)].bsdf;
  out.has_shading_derivatives = bsdf >= turned_.size() || !turned_[bsdf];
  return out;
}

// A ray down onto the point, of which Geometry makes the hit by the arithmetic of all hits. It starts on a
// triangle, and as far from a round surface as that is large.
SurfaceHit SurfacePoints::hit(const CanonicalPoint& point) const {
  CanonicalPoint own = point;
  own.instance = kNone;
  const SurfaceGeometry local = surface_geometry(geometry_, own);
  const auto kind = static_cast<PrimitiveKind>(point.kind);
  Vec3d out = local.ng;
  double height = 0;
  if (kind == PrimitiveKind::sphere) {
    const Sphere& sphere = geometry_.spheres[point.primitive].sphere;
    height = sphere.radius;
    if (sphere.inside_out) out = -out;
  } else if (kind == PrimitiveKind::cylinder) {
    const Cylinder& cylinder = geometry_.cylinders[point.primitive].cylinder;
    height = cylinder.radius;
    if (cylinder.inside_out) out = -out;
  } else if (kind == PrimitiveKind::disk) {
    height = geometry_.disks[point.primitive].disk.radius;
  }
  const Vec3d origin = local.p + out * height;
  SurfaceHit hit;
  if (point.instance == kNone) {
    geometry_.hit({Vec3(origin), Vec3(-out)}, kind, point.primitive, hit);
  } else {
    const Transform& to_world = geometry_.instances[point.instance].to_world;
    const Ray ray{Vec3(to_world.point(origin)), Vec3(normalize(to_world.vector(-out)))};
    geometry_.instance_hit(ray, point.instance, kind, point.primitive, hit);
  }
  hit.distance = 0;
  return hit;
}

bool SurfacePoints::exists(const CanonicalPoint& point) const {
  return scene::exists(geometry_, point);
}

}  // namespace candela::scene
