#include "worker/scene/clearance.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "worker/scene/shapes/geometry_steps.h"

namespace candela::scene {
namespace {

double distance_to_box(const Bounds& box, const Vec3d& p) {
  const auto beyond = [](double low, double high, double x) { return std::max({low - x, 0.0, x - high}); };
  return length(Vec3d{beyond(box.low.x, box.high.x, p.x), beyond(box.low.y, box.high.y, p.y),
                      beyond(box.low.z, box.high.z, p.z)});
}

double distance_to_segment(const Vec3d& a, const Vec3d& b, const Vec3d& p) {
  const Vec3d along = b - a;
  const double squared = length_squared(along);
  const double t = squared > 0 ? std::clamp(dot(p - a, along) / squared, 0.0, 1.0) : 0.0;
  return length(p - (a + along * t));
}

double distance_to(const Geometry& geometry, unsigned id, std::uint32_t primitive, const Vec3d& p) {
  if (id >= kPrimitiveKinds) return distance_to_box(geometry.instances[primitive].bounds, p);
  switch (static_cast<PrimitiveKind>(id)) {
    case PrimitiveKind::triangle: {
      const auto corners = corners_of(geometry, primitive);
      return distance_to_triangle({Vec3d(corners[0]), Vec3d(corners[1]), Vec3d(corners[2])}, p);
    }
    case PrimitiveKind::sphere: {
      const Sphere& sphere = geometry.spheres[primitive].sphere;
      return std::abs(length(p - sphere.center) - sphere.radius);
    }
    case PrimitiveKind::disk:
      return distance_to_box(bounds_of(geometry.disks[primitive].disk), p);
    case PrimitiveKind::cylinder:
      return distance_to_box(bounds_of(geometry.cylinders[primitive].cylinder), p);
  }
  return 0;
}

bool come_closer(RTCPointQueryFunctionArguments* args) {
  const RTCPointQuery& query = *args->query;
  const Vec3d p(Vec3{query.x, query.y, query.z});
  const auto distance = static_cast<float>(
      distance_to(*static_cast<const Geometry*>(args->userPtr), args->geomID, args->primID, p));
  if (!(distance < query.radius)) return false;
  args->query->radius = distance;
  return true;
}

}  // namespace

double distance_to_triangle(const std::array<Vec3d, 3>& corners, const Vec3d& p) {
  const Vec3d n = cross(corners[1] - corners[0], corners[2] - corners[0]);
  const double area = length(n);
  bool over = area > 0;  // over its inside
  double nearest = 1e300;
  for (std::size_t i = 0; i < 3; ++i) {
    const Vec3d &a = corners[i], &b = corners[(i + 1) % 3];
    over = over && dot(cross(b - a, p - a), n) >= 0;
    nearest = std::min(nearest, distance_to_segment(a, b, p));
  }
  return over ? std::abs(dot(p - corners[0], n)) / area : nearest;
}

float tree_clearance(RTCScene tree, const Geometry& geometry, Vec3 p, float limit) {
  RTCPointQuery query;
  query.x = p.x;
  query.y = p.y;
  query.z = p.z;
  query.time = 0;
  query.radius = limit;
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  // Embree's pointer is not const; the callback only reads.
  rtcPointQuery(tree, &query, &context, come_closer, const_cast<Geometry*>(&geometry));
  return query.radius;
}

}  // namespace candela::scene
