// Joining shapes, and computing hits.
//
// Error bounds. Let e = 2^-24, the largest relative rounding error of a float. A hit point is computed in
// double and rounded once: it leaves its plane by at most e * sum |n_i p_i|. A new ray's origin p + n h is
// rounded again: the same once more. Embree then subtracts the origin from the triangle's corners in float
// and evaluates the plane equation: its distance has an error of a few e times the triangle's extent
// (measured by the tests: below 2 e extent for well-shaped triangles, more for slivers, whose normal is worse
// conditioned). So h = e (3 sum |n_i p_i| + c extent).
#include "worker/scene/shapes/geometry.h"

#include <cmath>

#include "worker/core/math.h"

namespace candela::scene {
namespace {

constexpr float kHalfUlp = 0x1p-24f;
constexpr double kPlaneErrorFactor = 6;

float rounding_error(Vec3 n, Vec3 p) {
  return 3 * kHalfUlp * (std::abs(n.x * p.x) + std::abs(n.y * p.y) + std::abs(n.z * p.z));
}

Triangle make_triangle(Vec3 v0, Vec3 v1, Vec3 v2) {
  Triangle t;
  t.v0 = v0;
  t.v1 = v1;
  t.v2 = v2;
  const Vec3d a(v0), b(v1), c(v2);
  const Vec3d n = cross(b - a, c - a);
  t.ng = Vec3(normalize(n));
  const double longest =
      std::sqrt(std::max(length_squared(b - a), std::max(length_squared(c - b), length_squared(a - c))));
  // Longest edge over the height on it: 1.15 for an equilateral triangle.
  const double sliver = std::min(longest * longest / length(n), 1e3);
  t.plane_error =
      static_cast<float>(static_cast<double>(kHalfUlp) * kPlaneErrorFactor * longest * (1 + sliver / 4));
  return t;
}

// The tangent frame along dp/du, made orthogonal to n; any frame where the parameterisation is degenerate.
Frame frame_along(Vec3 n, Vec3d dp_du) {
  const Vec3d nd(n);
  const Vec3d s = dp_du - nd * dot(nd, dp_du);
  const double l = length(s);
  if (!(l > 1e-10 * length(dp_du)) || !std::isfinite(l)) return make_frame(n);
  const Vec3 unit = Vec3(s / l);
  return {unit, cross(n, unit), n};
}

}  // namespace

void Geometry::add(Shape shape, ShapeRecord record) {
  const auto shape_index = static_cast<std::uint32_t>(shapes.size());
  if (shape.sphere) {
    record.sphere = static_cast<std::uint32_t>(spheres.size());
    const Sphere& s = *shape.sphere;
    bounds.add(s.center - Vec3d(s.radius, s.radius, s.radius));
    bounds.add(s.center + Vec3d(s.radius, s.radius, s.radius));
    spheres.push_back({s, shape_index});
  }
  record.first_triangle = static_cast<std::uint32_t>(triangles.size());
  record.triangle_count = static_cast<std::uint32_t>(shape.triangles.size());
  const std::size_t base = positions.size();
  const bool mapped = record.reads_uv && !shape.uvs.empty();
  positions.insert(positions.end(), shape.positions.begin(), shape.positions.end());
  if (!shape.normals.empty()) {
    normals.resize(base);
    normals.insert(normals.end(), shape.normals.begin(), shape.normals.end());
  }
  if (mapped) {
    uvs.resize(base);
    uvs.insert(uvs.end(), shape.uvs.begin(), shape.uvs.end());
  }
  triangles.reserve(triangles.size() + shape.triangles.size());
  indices.reserve(indices.size() + shape.triangles.size());
  for (const auto& t : shape.triangles) {
    Triangle triangle = make_triangle(shape.positions[t[0]], shape.positions[t[1]], shape.positions[t[2]]);
    triangle.shape = shape_index;
    triangle.smooth = !shape.normals.empty();
    triangle.mapped = mapped;
    triangles.push_back(triangle);
    std::array<std::uint32_t, 3> index{};
    for (std::size_t k = 0; k < 3; ++k) index[k] = t[k] + static_cast<std::uint32_t>(base);
    indices.push_back(index);
    for (const std::uint32_t v : t) bounds.add(Vec3d(shape.positions[v]));
  }
  shapes.push_back(record);
}

void Geometry::finish() {
  positions.emplace_back();
  if (!normals.empty()) normals.resize(positions.size());
  if (!uvs.empty()) uvs.resize(positions.size());
}

void Geometry::triangle_hit(const Ray& ray, std::uint32_t index, SurfaceHit& hit) const {
  const Triangle& t = triangles[index];
  const Vec3d v0(t.v0), e1 = Vec3d(t.v1) - v0, e2 = Vec3d(t.v2) - v0, d(ray.direction),
                        s = Vec3d(ray.origin) - v0;
  // Moeller and Trumbore 1997, in double. Embree says that the ray meets the triangle; what rounding leaves
  // outside is clamped onto it.
  const Vec3d n = cross(e1, e2);
  const double determinant = -dot(d, n);
  const double inverse = determinant != 0 ? 1 / determinant : 0;
  const Vec3d moment = cross(s, d);
  double b1 = std::clamp(dot(e2, moment) * inverse, 0.0, 1.0);
  double b2 = std::clamp(-dot(e1, moment) * inverse, 0.0, 1.0);
  if (const double sum = b1 + b2; sum > 1) {
    b1 /= sum;
    b2 /= sum;
  }
  const double b0 = 1 - b1 - b2;
  hit.p = Vec3(v0 + e1 * b1 + e2 * b2);
  hit.distance = static_cast<float>(std::max(0.0, dot(s, n) * inverse));
  hit.ng = t.ng;
  hit.error = rounding_error(t.ng, hit.p) + t.plane_error;
  hit.primitive = index;
  hit.shape = t.shape;
  const ShapeRecord& record = shapes[t.shape];
  hit.bsdf = record.bsdf;
  hit.emitter = record.emitter;
  hit.uv = {static_cast<float>(b1), static_cast<float>(b2)};
  if (!t.smooth && !t.mapped) {
    hit.shading = make_frame(t.ng);
    return;
  }
  const auto& v = indices[index];
  Vec3 shading = t.ng;
  if (t.smooth) {
    const Vec3d mean = Vec3d(normals[v[0]]) * b0 + Vec3d(normals[v[1]]) * b1 + Vec3d(normals[v[2]]) * b2;
    const double l = length(mean);
    // Triangles were turned to their vertex normals at load, so that the two disagree only where vertex
    // normals of one triangle spread by more than a right angle; the face decides there. (Mitsuba 0.6 turns
    // the face there.)
    if (l > 1e-6 && dot(mean, Vec3d(t.ng)) > 1e-6 * l) shading = Vec3(mean / l);
  }
  if (!t.mapped) {
    hit.shading = make_frame(shading);
    return;
  }
  const Vec2 a = uvs[v[0]], b = uvs[v[1]], c = uvs[v[2]];
  const double du1 = static_cast<double>(b.x) - static_cast<double>(a.x),
               dv1 = static_cast<double>(b.y) - static_cast<double>(a.y);
  const double du2 = static_cast<double>(c.x) - static_cast<double>(a.x),
               dv2 = static_cast<double>(c.y) - static_cast<double>(a.y);
  hit.uv = {static_cast<float>(static_cast<double>(a.x) + du1 * b1 + du2 * b2),
            static_cast<float>(static_cast<double>(a.y) + dv1 * b1 + dv2 * b2)};
  const double uv_determinant = du1 * dv2 - dv1 * du2;
  hit.shading = uv_determinant != 0 ? frame_along(shading, (e1 * dv2 - e2 * dv1) / uv_determinant)
                                    : make_frame(shading);
}

bool sphere_distances(const Sphere& sphere, Vec3d origin, Vec3d direction, double& near, double& far) {
  // The discriminant from the distance of the line to the centre, which does not cancel far away (Haines et
  // al. 2019).
  const Vec3d f = origin - sphere.center;
  const double a = dot(direction, direction);
  if (!(a > 0)) return false;
  const double b = -dot(f, direction) / a;
  const Vec3d closest = f + direction * b;
  const double rest = sphere.radius * sphere.radius - dot(closest, closest);
  if (!(rest >= 0)) return false;
  const double half = std::sqrt(rest / a);
  // Of the two roots the one far from zero is sure; the other follows from their product, which is exact near
  // the surface.
  const double product = (dot(f, f) - sphere.radius * sphere.radius) / a;
  const double sure = b >= 0 ? b + half : b - half;
  const double other = sure != 0 ? product / sure : 0.0;
  near = std::min(sure, other);
  far = std::max(sure, other);
  return true;
}

void Geometry::sphere_hit(const Ray& ray, std::uint32_t index, SurfaceHit& hit) const {
  const SphereRecord& record = spheres[index];
  const Sphere& sphere = record.sphere;
  const Vec3d origin(ray.origin), direction(ray.direction);
  double near = 0, far = 0;
  Vec3d n{0, 0, 1};
  double distance = 0;
  if (sphere_distances(sphere, origin, direction, near, far)) {
    distance = near > 0 ? near : std::max(far, 0.0);
    n = normalize(origin + direction * distance - sphere.center);
  }
  hit.p = Vec3(sphere.center + n * sphere.radius);
  hit.distance = static_cast<float>(distance);
  const Vec3d outward = sphere.inside_out ? -n : n;
  hit.ng = Vec3(outward);
  // Rounding of p and of the new origin, and what double leaves of the cancellation at the centre's distance.
  hit.error = rounding_error(hit.ng, hit.p) + static_cast<float>(sphere.radius * 0x1p-40);
  hit.primitive = index;
  hit.shape = record.shape;
  const ShapeRecord& shape = shapes[record.shape];
  hit.bsdf = shape.bsdf;
  hit.emitter = shape.emitter;
  if (!shape.reads_uv) {
    hit.uv = {0, 0};
    hit.shading = make_frame(hit.ng);
    return;
  }
  const Vec3d local{dot(sphere.axes[0], n), dot(sphere.axes[1], n), dot(sphere.axes[2], n)};
  hit.uv = sphere_uv(sphere, n);
  hit.shading = frame_along(hit.ng, sphere.axes[1] * local.x - sphere.axes[0] * local.y);
}

Vec2 sphere_uv(const Sphere& sphere, Vec3d n) {
  // u turns around the local z axis, v falls from it.
  const Vec3d local{dot(sphere.axes[0], n), dot(sphere.axes[1], n), dot(sphere.axes[2], n)};
  float u = math::atan2f(static_cast<float>(local.y), static_cast<float>(local.x)) * (0.5f * math::kInvPi);
  if (u < 0) u += 1;
  const auto radial = static_cast<float>(std::sqrt(local.x * local.x + local.y * local.y));
  return {u, math::atan2f(radial, static_cast<float>(local.z)) * math::kInvPi};
}

Vec2 Geometry::uv_at(std::uint32_t triangle, float b1, float b2) const {
  if (!triangles[triangle].mapped) return {b1, b2};
  const auto& v = indices[triangle];
  const Vec2 a = uvs[v[0]], b = uvs[v[1]], c = uvs[v[2]];
  return {a.x + (b.x - a.x) * b1 + (c.x - a.x) * b2, a.y + (b.y - a.y) * b1 + (c.y - a.y) * b2};
}

float Geometry::point_error(std::uint32_t triangle, Vec3 p) const {
  const Triangle& t = triangles[triangle];
  return rounding_error(t.ng, p) + t.plane_error;
}

}  // namespace candela::scene
