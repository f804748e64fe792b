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
#include <limits>
#include <numbers>

#include "common/base/huge_page_advice.h"
#include "worker/loaders/parallel.h"
#include "worker/scene/shapes/geometry_steps.h"
#include "worker/scene/shapes/rounding.h"

namespace candela::scene {
namespace {

constexpr double kPlaneErrorFactor = 6;

// Writes in place, as make_triangles() reads the corners next: a copy would be read back in wider pieces than
// it was stored in, and the processor would wait.
void set_corners(Triangle& t, Vec3 v0, Vec3 v1, Vec3 v2) {
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
}

// The tangent frame along dp/du, made orthogonal to n; any frame where the parameterization is degenerate.
Frame frame_along(Vec3 n, Vec3d dp_du) {
  const Vec3d nd(n);
  const Vec3d s = dp_du - nd * dot(nd, dp_du);
  const double l = length(s);
  if (!(l > 1e-10 * length(dp_du)) || !std::isfinite(l)) return make_frame(n);
  const Vec3 unit = Vec3(s / l);
  return {unit, cross(n, unit), n};
}

// Moves all of `from` behind what is there; a first one is not even copied. Growth is geometric, for scenes
// of many small shapes.
template <class T>
void append(std::vector<T>& to, std::vector<T>&& from) {
  if (to.empty()) {
    to = std::move(from);
  } else {
    // One more, for finish_vertices().
    const std::size_t count = to.size() + from.size() + 1;
    if (count > to.capacity()) reserve_huge(to, std::max(count, 2 * to.capacity()));
    to.insert(to.end(), from.begin(), from.end());
  }
}

// As floats, which a parameterization squeezed to almost nothing may overflow.
Vec3 finite(Vec3d v) {
  constexpr double kMax = 1e18;
  return {static_cast<float>(std::clamp(v.x, -kMax, kMax)), static_cast<float>(std::clamp(v.y, -kMax, kMax)),
          static_cast<float>(std::clamp(v.z, -kMax, kMax))};
}

constexpr double kTwoPi = 2 * std::numbers::pi;

}  // namespace

void Geometry::expect(const std::vector<loaders::MeshAttribute>& shape_attributes) {
  for (const loaders::MeshAttribute& from : shape_attributes) {
    const auto [found, is_new] = attributes.try_emplace(from.name);
    Attribute& attribute = found->second;
    if (is_new) {
      attribute.of_faces = from.of_faces();
      attribute.minimum = attribute.maximum = from.values.front();
    }
    Spectrum &least = attribute.minimum, &most = attribute.maximum;
    for (const Spectrum v : from.values) {
      least = min(least, v);
      most = max(most, v);
    }
  }
}

void Geometry::add(Shape shape, ShapeRecord record) {
  const auto shape_index = static_cast<std::uint32_t>(shapes.size());
  Group& group = groups.back();
  const auto one_more = [&](PrimitiveKind kind, const Bounds& box) {
    ++group.primitives[static_cast<std::size_t>(kind)].count;
    group.bounds.add(box);
  };
  if (shape.sphere) {
    record.sphere = static_cast<std::uint32_t>(spheres.size());
    one_more(PrimitiveKind::sphere, bounds_of(*shape.sphere));
    spheres.push_back({*shape.sphere, shape_index});
  }
  if (shape.disk) {
    record.disk = static_cast<std::uint32_t>(disks.size());
    one_more(PrimitiveKind::disk, bounds_of(*shape.disk));
    disks.push_back({*shape.disk, shape_index});
  }
  if (shape.cylinder) {
    record.cylinder = static_cast<std::uint32_t>(cylinders.size());
    one_more(PrimitiveKind::cylinder, bounds_of(*shape.cylinder));
    cylinders.push_back({*shape.cylinder, shape_index});
  }
  const std::size_t first = indices.size(), count = shape.triangles.size(), base = positions.size();
  record.first_triangle = static_cast<std::uint32_t>(first);
  record.triangle_count = static_cast<std::uint32_t>(count);
  Triangle& start = triangles.emplace_back();
  start.shape = shape_index;
  start.smooth = !shape.normals.empty();
  start.mapped = record.reads_uv && !shape.uvs.empty();
  start.partials = record.reads_partials;
  append(positions, std::move(shape.positions));
  if (start.smooth) {
    normals.resize(base);
    append(normals, std::move(shape.normals));
  }
  if (start.mapped) {
    uvs.resize(base);
    append(uvs, std::move(shape.uvs));
  }
  append(indices, std::move(shape.triangles));
  for (loaders::MeshAttribute& from : shape.attributes) {
    Attribute& attribute = attributes.find(from.name)->second;
    attribute.first.resize(shape_index + 1);
    // Modulo 2^32, as the sum with the index will be.
    attribute.first[shape_index] =
        static_cast<std::uint32_t>(attribute.values.size() - (attribute.of_faces ? first : base));
    append(attribute.values, std::move(from.values));
  }
  group.bounds.add(loaders::joined_over(count, Bounds{}, [&](std::size_t i, Bounds& box) {
    for (std::uint32_t& v : indices[first + i]) v += static_cast<std::uint32_t>(base);
    box.add(bounds_of_triangle(static_cast<std::uint32_t>(first + i)));
  }));
  if (record.reads_mean_edge && count > 0) {
    double sum = 0;
    for (std::size_t i = first; i < first + count; ++i) {
      const auto [v0, v1, v2] = corners_of(*this, static_cast<std::uint32_t>(i));
      const Vec3d a(v0), b(v1), c(v2);
      sum += length(b - a) + length(c - b) + length(a - c);
    }
    mean_edges.resize(shape_index + 1);
    mean_edges[shape_index] = sum / (3 * static_cast<double>(count));
  }
  group.primitives[static_cast<std::size_t>(PrimitiveKind::triangle)].count += record.triangle_count;
  shapes.push_back(record);
  if (groups.size() == 1) bounds = group.bounds;
}

std::uint32_t Geometry::begin_group() {
  Group group;
  const std::array<std::size_t, kPrimitiveKinds> sizes = {indices.size(), spheres.size(), disks.size(),
                                                          cylinders.size()};
  for (std::size_t k = 0; k < kPrimitiveKinds; ++k) {
    group.primitives[k].first = static_cast<std::uint32_t>(sizes[k]);
  }
  groups.push_back(group);
  return static_cast<std::uint32_t>(groups.size() - 1);
}

void Geometry::add_instance(std::uint32_t group, const Transform& to_world) {
  Instance out{group, to_world, 0, {}};
  for (const Vec3d axis : {Vec3d{1, 0, 0}, Vec3d{0, 1, 0}, Vec3d{0, 0, 1}}) {
    out.inverse_norm += length_squared(to_world.inverse_vector(axis));
  }
  out.inverse_norm = std::sqrt(out.inverse_norm);
  const Bounds& box = groups[group].bounds;
  for (unsigned corner = 0; corner < 8; ++corner) {
    out.bounds.add(to_world.point({(corner & 1) != 0 ? box.low.x : box.high.x,
                                   (corner & 2) != 0 ? box.low.y : box.high.y,
                                   (corner & 4) != 0 ? box.low.z : box.high.z}));
  }
  bounds.add(out.bounds);
  instances.push_back(out);
}

Bounds Geometry::bounds_of_triangle(std::uint32_t triangle) const {
  Bounds box;
  for (const std::uint32_t v : indices[triangle]) box.add(Vec3d(positions[v]));
  return box;
}

bool Geometry::may_cross(std::uint32_t index, const Bounds& box) const {
  const ShapeRecord& shape = shapes[index];
  for (std::uint32_t i = shape.first_triangle; i < shape.first_triangle + shape.triangle_count; ++i) {
    if (!overlap(bounds_of_triangle(i), box)) continue;
    const Triangle& triangle = triangles[i];
    const double height = dot(Vec3d(triangle.ng), box.center() - Vec3d(triangle.v0));
    if (std::abs(height) <= box.radius() + static_cast<double>(triangle.plane_error)) return true;
  }
  if (shape.disk != kNone && overlap(bounds_of(disks[shape.disk].disk), box)) return true;
  if (shape.cylinder != kNone && overlap(bounds_of(cylinders[shape.cylinder].cylinder), box)) return true;
  if (shape.sphere == kNone) return false;
  const Sphere& sphere = spheres[shape.sphere].sphere;
  const double distance = length(box.center() - sphere.center);
  return std::abs(distance - sphere.radius) <= box.radius() + 1e-6 * sphere.radius;
}

Bounds Geometry::bounds_of_shape(std::uint32_t index) const {
  const ShapeRecord& shape = shapes[index];
  Bounds box;
  if (shape.sphere != kNone) box.add(bounds_of(spheres[shape.sphere].sphere));
  if (shape.disk != kNone) box.add(bounds_of(disks[shape.disk].disk));
  if (shape.cylinder != kNone) box.add(bounds_of(cylinders[shape.cylinder].cylinder));
  for (std::uint32_t i = 0; i < shape.triangle_count; ++i)
    box.add(bounds_of_triangle(shape.first_triangle + i));
  return box;
}

void finish_vertices(Geometry& geometry) {
  auto &positions = geometry.positions, &normals = geometry.normals;
  auto& uvs = geometry.uvs;
  // Reserving just one more keeps the arrays from doubling here.
  positions.reserve(positions.size() + 1);
  if (!normals.empty()) normals.reserve(positions.size() + 1);
  if (!uvs.empty()) uvs.reserve(positions.size() + 1);
  positions.emplace_back();
  if (!normals.empty()) normals.resize(positions.size());
  if (!uvs.empty()) uvs.resize(positions.size());
}

void make_triangles(Geometry& geometry) {
  // The array grows by parts that stay in a cache until they are filled: memory is written once.
  const std::size_t part = loaders::kGrain * std::max<std::size_t>(1, loaders::thread_count());
  std::vector<Triangle> made;
  reserve_huge(made, geometry.indices.size());
  for (const Triangle& start : geometry.triangles) {
    const ShapeRecord& shape = geometry.shapes[start.shape];
    const std::size_t end_of_shape = std::size_t{shape.first_triangle} + shape.triangle_count;
    for (std::size_t first = shape.first_triangle; first < end_of_shape; first = made.size()) {
      made.resize(std::min(first + part, end_of_shape));
      loaders::for_ranges(made.size() - first, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = first + begin; i < first + end; ++i) {
          const auto& v = geometry.indices[i];
          Triangle& triangle = made[i];
          set_corners(triangle, geometry.positions[v[0]], geometry.positions[v[1]], geometry.positions[v[2]]);
          triangle.shape = start.shape;
          triangle.smooth = start.smooth;
          triangle.mapped = start.mapped;
          triangle.partials = start.partials;
        }
      });
    }
  }
  geometry.triangles = std::move(made);
}

void Geometry::finish() {
  finish_vertices(*this);
  make_triangles(*this);
}

void Geometry::triangle_hit(const Ray& ray, std::uint32_t index, SurfaceHit& hit) const {
  const Triangle& t = triangles[index];
  // In a large scene the record, the indices and the normals are each far away in memory. What is read at the
  // end is asked for at the start: the processor does not look so far ahead.
  __builtin_prefetch(&indices[index]);
  const Vec3d v0(t.v0), e1 = Vec3d(t.v1) - v0, e2 = Vec3d(t.v2) - v0, d(ray.direction),
                        s = Vec3d(ray.origin) - v0;
  if (t.smooth) {
    for (const std::uint32_t v : indices[index]) __builtin_prefetch(&normals[v]);
  }
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
  name_hit(t.shape, index, hit);
  hit.barycentric = {static_cast<float>(b1), static_cast<float>(b2)};
  hit.uv = hit.barycentric;
  if (!t.smooth && !t.mapped) {
    hit.shading = make_frame(t.ng);
    if (t.partials) [[unlikely]]
      triangle_partials(index, hit);
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
    if (t.partials) [[unlikely]]
      triangle_partials(index, hit);
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
  if (t.partials) [[unlikely]]
    triangle_partials(index, hit);
}

// On its own, since few hits need it and its registers would be missed by all.
void Geometry::triangle_partials(std::uint32_t index, SurfaceHit& hit) const {
  const Triangle& t = triangles[index];
  const Vec3d v0(t.v0), e1 = Vec3d(t.v1) - v0, e2 = Vec3d(t.v2) - v0;
  if (!t.mapped) {
    // Derivatives by the barycentric coordinates, the parameters of a mesh without (u, v).
    hit.dp_du = Vec3(e1);
    hit.dp_dv = Vec3(e2);
    return;
  }
  const auto& v = indices[index];
  const Vec2 a = uvs[v[0]], b = uvs[v[1]], c = uvs[v[2]];
  const double du1 = static_cast<double>(b.x) - static_cast<double>(a.x),
               dv1 = static_cast<double>(b.y) - static_cast<double>(a.y);
  const double du2 = static_cast<double>(c.x) - static_cast<double>(a.x),
               dv2 = static_cast<double>(c.y) - static_cast<double>(a.y);
  const double uv_determinant = du1 * dv2 - dv1 * du2;
  if (uv_determinant == 0) {
    hit.dp_du = hit.shading.s;
    hit.dp_dv = hit.shading.t;
    return;
  }
  hit.dp_du = finite((e1 * dv2 - e2 * dv1) / uv_determinant);
  hit.dp_dv = finite((e2 * du1 - e1 * du2) / uv_determinant);
}

void Geometry::quadric_hit(const Ray& ray, PrimitiveKind kind, std::uint32_t primitive,
                           SurfaceHit& hit) const {
  switch (kind) {
    case PrimitiveKind::triangle:
      return triangle_hit(ray, primitive, hit);
    case PrimitiveKind::sphere:
      return sphere_hit(ray, primitive, hit);
    case PrimitiveKind::disk:
      return disk_hit(ray, primitive, hit);
    case PrimitiveKind::cylinder:
      return cylinder_hit(ray, primitive, hit);
  }
}

void Geometry::sphere_hit(const Ray& ray, std::uint32_t index, SurfaceHit& hit) const {
  const Sphere& sphere = spheres[index].sphere;
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
  hit.ng = Vec3(sphere.inside_out ? -n : n);
  hit.error = sphere_error(sphere, hit.p, hit.ng);
  const ShapeRecord& record = name_hit(spheres[index].shape, kNone, hit);
  if (!record.reads_uv && !record.reads_partials) {
    hit.uv = {0, 0};
    hit.shading = make_frame(hit.ng);
    return;
  }
  const Vec3d local{dot(sphere.axes[0], n), dot(sphere.axes[1], n), dot(sphere.axes[2], n)};
  hit.uv = sphere_uv(sphere, n);
  const Vec3d around = sphere.axes[1] * local.x - sphere.axes[0] * local.y;
  hit.shading = frame_along(hit.ng, around);
  if (record.reads_partials) {
    const double r = std::sqrt(local.x * local.x + local.y * local.y);
    const Vec3d radial =
        r > 0 ? sphere.axes[0] * (local.x / r) + sphere.axes[1] * (local.y / r) : sphere.axes[0];
    hit.dp_du = Vec3(around * (kTwoPi * sphere.radius));
    hit.dp_dv = Vec3((radial * local.z - sphere.axes[2] * r) * (std::numbers::pi * sphere.radius));
  }
}

void Geometry::disk_hit(const Ray& ray, std::uint32_t index, SurfaceHit& hit) const {
  const Disk& disk = disks[index].disk;
  const Vec3d origin(ray.origin), direction(ray.direction);
  // Embree says that they meet, and not edge-on; what rounding leaves outside is moved onto the disk.
  const double fall = dot(direction, disk.axes[2]);
  const double t = fall != 0 ? std::max(0.0, dot(disk.center - origin, disk.axes[2]) / fall) : 0.0;
  const Vec3d f = origin + direction * t - disk.center;
  double x = dot(f, disk.axes[0]), y = dot(f, disk.axes[1]);
  const double r = std::sqrt(x * x + y * y);
  if (r > disk.radius) {
    x *= disk.radius / r;
    y *= disk.radius / r;
  }
  const Vec3d p = disk.center + disk.axes[0] * x + disk.axes[1] * y;
  hit.p = Vec3(p);
  hit.distance = static_cast<float>(t);
  hit.ng = Vec3(disk.axes[2]);
  hit.error = disk_error(disk, hit.p);
  const ShapeRecord& record = name_hit(disks[index].shape, kNone, hit);
  if (!record.reads_uv && !record.reads_partials) {
    hit.uv = {0, 0};
    hit.shading = make_frame(hit.ng);
    return;
  }
  hit.uv = disk_uv(disk, p);
  // At the center, where the angle has no meaning, it is zero, as Mitsuba has it.
  const Vec3d radial = r > 0 ? disk.axes[0] * (x / r) + disk.axes[1] * (y / r) : disk.axes[0];
  hit.shading = frame_along(hit.ng, radial);
  if (record.reads_partials) {
    hit.dp_du = Vec3(radial * disk.radius);
    hit.dp_dv = Vec3((disk.axes[1] * x - disk.axes[0] * y) * kTwoPi);
  }
}

void Geometry::cylinder_hit(const Ray& ray, std::uint32_t index, SurfaceHit& hit) const {
  const Cylinder& cylinder = cylinders[index].cylinder;
  const Vec3d origin(ray.origin), direction(ray.direction);
  double t = 0;
  if (!meet(cylinder, origin, direction, 0, std::numeric_limits<double>::infinity(), t)) t = 0;
  const Vec3d f = origin + direction * t - cylinder.base;
  const double z = std::clamp(dot(f, cylinder.axes[2]), 0.0, cylinder.length);
  double x = dot(f, cylinder.axes[0]), y = dot(f, cylinder.axes[1]);
  const double r = std::sqrt(x * x + y * y);
  x = r > 0 ? x / r : 1;
  y = r > 0 ? y / r : 0;
  const Vec3d n = cylinder.axes[0] * x + cylinder.axes[1] * y;
  const Vec3d p = cylinder.base + cylinder.axes[2] * z + n * cylinder.radius;
  hit.p = Vec3(p);
  hit.distance = static_cast<float>(t);
  hit.ng = Vec3(cylinder.inside_out ? -n : n);
  hit.error = cylinder_error(cylinder, hit.p, hit.ng);
  const ShapeRecord& record = name_hit(cylinders[index].shape, kNone, hit);
  if (!record.reads_uv && !record.reads_partials) {
    hit.uv = {0, 0};
    hit.shading = make_frame(hit.ng);
    return;
  }
  hit.uv = cylinder_uv(cylinder, p);
  const Vec3d around = cylinder.axes[1] * x - cylinder.axes[0] * y;
  hit.shading = frame_along(hit.ng, around);
  if (record.reads_partials) {
    hit.dp_du = Vec3(around * (kTwoPi * cylinder.radius));
    hit.dp_dv = Vec3(cylinder.axes[2] * cylinder.length);
  }
}

Ray Geometry::to_group(const Instance& instance, const Ray& ray) {
  // In double, rounded once: the group's own error bounds count on no more than that.
  return {Vec3(instance.to_world.inverse_point(Vec3d(ray.origin))),
          Vec3(instance.to_world.inverse_vector(Vec3d(ray.direction))), ray.t_max};
}

// Error bound. Let E bound what the group needs (which counts three roundings; here there are more: of p in
// the group, of p and the new origin in the world, of that origin in the group again, so 2 E), and L the
// inverse's linear part. A step h along the world's normal climbs h |L^T n| over the surface in the group, so
// that h = 2 E / |L^T n| beside what rounding in the world can do to p.
void Geometry::instance_hit(const Ray& ray, std::uint32_t index, PrimitiveKind kind, std::uint32_t primitive,
                            SurfaceHit& local) const {
  const Instance& instance = instances[index];
  const Transform& to_world = instance.to_world;
  hit(to_group(instance, ray), kind, primitive, local);
  const Vec3d p = to_world.point(Vec3d(local.p));
  const Vec3d climb = to_world.covector(Vec3d(local.ng));
  const double slope = length(climb);
  // A round surface bends below a point that rounding in the world moves along it.
  double bend = 0;
  const double slip = 2.0 * static_cast<double>(kHalfUlp) * instance.inverse_norm *
                      (std::abs(p.x) + std::abs(p.y) + std::abs(p.z));
  if (kind == PrimitiveKind::sphere) bend = slip * slip / spheres[primitive].sphere.radius;
  if (kind == PrimitiveKind::cylinder) bend = slip * slip / cylinders[primitive].cylinder.radius;
  const Vec3d n = to_world.covector(Vec3d(local.shading.n));
  local.p = Vec3(p);
  local.ng = Vec3(climb / slope);
  local.error = rounding_error(local.ng, local.p) +
                static_cast<float>((2 * static_cast<double>(local.error) + bend) / slope);
  // Uneven scales may turn a shading normal to the other side of the surface; the face decides there.
  const double l = length(n);
  const Vec3 shading = dot(n, climb) > 1e-6 * l * slope ? Vec3(n / l) : local.ng;
  const ShapeRecord& record = shapes[local.shape];
  if (!record.reads_partials) {
    local.shading = make_frame(shading);
    return;
  }
  const Vec3d dp_du = to_world.vector(Vec3d(local.dp_du));
  local.shading = frame_along(shading, dp_du);
  local.dp_du = finite(dp_du);
  local.dp_dv = finite(to_world.vector(Vec3d(local.dp_dv)));
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
