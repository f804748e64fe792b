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
  if (set_meeting_on_triangle(geometry_, origin, direction, point)) return point;
  // A ray meets a round surface twice: take the place that Scene::intersect() takes.
  SurfaceHit rounded;
  if (found.instance == kNone)
    geometry_.hit(ray, found.kind, found.primitive, rounded);
  else
    geometry_.instance_hit(ray, found.instance, found.kind, found.primitive, rounded);
  set_meeting(geometry_, origin, direction, Vec3d(rounded.p), point);
  return point;
}

std::optional<CanonicalPoint> SurfacePoints::of(const SurfaceHit& hit) const {
  const ShapeRecord& shape = geometry_.shapes[hit.shape];
  CanonicalPoint point;
  const auto name = [&](PrimitiveKind kind, std::uint32_t primitive) {
    point.kind = static_cast<std::uint8_t>(kind);
    point.primitive = primitive;
  };
  if (shape.sphere != kNone)
    name(PrimitiveKind::sphere, shape.sphere);
  else if (shape.disk != kNone)
    name(PrimitiveKind::disk, shape.disk);
  else if (shape.cylinder != kNone)
    name(PrimitiveKind::cylinder, shape.cylinder);
  else if (hit.primitive != kNone)
    name(PrimitiveKind::triangle, hit.primitive);
  else
    return std::nullopt;
  const Vec3d p(hit.p);
  const auto is_in = [&](const Group& group) {
    const Group::Range range = group.primitives[point.kind];
    return point.primitive >= range.first && point.primitive - range.first < range.count;
  };
  if (is_in(geometry_.groups[0])) {
    set_place(geometry_, p, point);
    return point;
  }
  // Hits do not name their instance: it is the one whose surface goes through p.
  std::optional<CanonicalPoint> best;
  double nearest = 16 * static_cast<double>(hit.error);
  for (std::uint32_t i = 0; i < geometry_.instances.size(); ++i) {
    const Instance& instance = geometry_.instances[i];
    if (!is_in(geometry_.groups[instance.group])) continue;
    const Vec3d pad{nearest, nearest, nearest};
    if (!overlap(instance.bounds, Bounds{p - pad, p + pad})) continue;
    point.instance = i;
    set_place(geometry_, p, point);
    const double distance = length(surface_geometry(geometry_, point).p - p);
    if (!(distance < nearest)) continue;
    nearest = distance;
    best = point;
  }
  return best;
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
  const LocalSpot local = local_spot(geometry_, point);
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
