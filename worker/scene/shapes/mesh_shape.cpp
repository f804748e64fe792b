// Meshes: from object space as the file has it to triangles in world space.
#include <algorithm>
#include <atomic>
#include <cmath>

#include "common/base/work_monitor.h"
#include "worker/core/math.h"
#include "worker/loaders/parallel.h"
#include "worker/scene/shapes/shape.h"

namespace candela::scene {
namespace {

// Embree loses its way beyond 1.8e18; squares of edges must stay finite in float too.
constexpr double kLargestCoordinate = 1e18;

Vec3d face_vector(const Shape& shape, const std::array<std::uint32_t, 3>& t) {
  const Vec3d a(shape.positions[t[0]]), b(shape.positions[t[1]]), c(shape.positions[t[2]]);
  return cross(b - a, c - a);
}

// Without area in the arithmetic of intersection: the normal's squared length must be a normal number, and
// the sine of the smallest angle above the noise of float coordinates.
bool has_area(const std::array<std::uint32_t, 3>& t, const Vec3d& face_vector) {
  if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) return false;
  return length_squared(face_vector) > 1e-60;
}
bool has_area(const Shape& shape, const std::array<std::uint32_t, 3>& t) {
  return has_area(t, face_vector(shape, t));
}

void swap_corners(std::vector<std::array<std::uint32_t, 3>>& triangles) {
  loaders::for_ranges(triangles.size(), [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) std::swap(triangles[i][1], triangles[i][2]);
  });
}

// Thuermer and Wuethrich 1998: normals of faces around a vertex weighted by their angle there. Only for
// vertices that have none; false marks them.
void complete_normals(Shape& shape, const std::vector<bool>& known) {
  const std::size_t count = shape.positions.size();
  // Each task owns a range of vertices, looks at all faces, and adds what concerns its own: a vertex's sum is
  // in the order of the faces, whatever the number of tasks.
  const std::size_t tasks = std::clamp<std::size_t>(loaders::thread_count(), 1, count / loaders::kGrain + 1);
  loaders::for_all(tasks, [&](std::size_t task) {
    const std::size_t begin = count * task / tasks, end = count * (task + 1) / tasks;
    std::vector<Vec3d> sums(end - begin);
    std::size_t step = 0;
    for (const auto& t : shape.triangles) {
      work_step(step++);
      const auto mine = [&](std::uint32_t v) { return v >= begin && v < end && !known[v]; };
      if (!mine(t[0]) && !mine(t[1]) && !mine(t[2])) continue;
      const std::array<Vec3d, 3> p = {Vec3d(shape.positions[t[0]]), Vec3d(shape.positions[t[1]]),
                                      Vec3d(shape.positions[t[2]])};
      const Vec3d area = cross(p[1] - p[0], p[2] - p[0]);
      const double twice_area = length(area);
      const Vec3d n = area / twice_area;
      for (std::size_t k = 0; k < 3; ++k) {
        if (!mine(t[k])) continue;
        // tan = |cross| / dot of the two edges; scaled into the range of floats.
        const double cosine = dot(p[(k + 1) % 3] - p[k], p[(k + 2) % 3] - p[k]);
        const double scale = 1 / std::max(twice_area, std::abs(cosine));
        sums[t[k] - begin] += n * static_cast<double>(math::atan2f(static_cast<float>(twice_area * scale),
                                                                   static_cast<float>(cosine * scale)));
      }
    }
    for (std::size_t i = begin; i < end; ++i) {
      if (known[i]) continue;
      const double l = length(sums[i - begin]);
      // Faces that cancel each other out leave no direction: a hit falls back on the face's normal there.
      shape.normals[i] = l > 1e-12 ? Vec3(sums[i - begin] / l) : Vec3{};
    }
  });
}

}  // namespace

Result<Shape> shape_from_mesh(loaders::Mesh mesh, const Transform& to_world, bool face_normals,
                              bool flip_normals, const std::string& name) {
  Shape shape;
  shape.dropped_count = mesh.dropped_face_count;
  shape.positions = std::move(mesh.positions);
  const std::size_t beyond = loaders::first_where(shape.positions.size(), [&](std::size_t i) {
    const Vec3d p = to_world.point(Vec3d(shape.positions[i]));
    shape.positions[i] = Vec3(p);
    return !(std::abs(p.x) <= kLargestCoordinate && std::abs(p.y) <= kLargestCoordinate &&
             std::abs(p.z) <= kLargestCoordinate);
  });
  if (beyond != loaders::kNowhere) {
    return input_error("vertex " + std::to_string(beyond) + " lies beyond 1e18 in the scene after to_world")
        .at(name, 0);
  }
  shape.uvs = std::move(mesh.uvs);
  shape.triangles = std::move(mesh.triangles);
  // A mirror turns the order of the corners around, but no surface inside out.
  if (to_world.determinant() < 0) swap_corners(shape.triangles);
  const bool smooth = !face_normals && !mesh.face_normals, given = smooth && !mesh.normals.empty();
  std::atomic<bool> all_known = given;
  if (smooth) {
    shape.normals = std::move(mesh.normals);
    shape.normals.resize(shape.positions.size());
    // A normal without length is none, and stays zero until it is completed.
    loaders::for_ranges(given ? shape.normals.size() : 0, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const Vec3d n = to_world.normal(Vec3d(shape.normals[i]));
        const double l = length(n);
        const bool known = l > 0 && std::isfinite(l);
        shape.normals[i] = known ? Vec3(n / l) : Vec3{};
        if (!known) all_known = false;
      }
    });
  }
  // One pass over the triangles finds those without area and turns the others to their vertex normals.
  std::atomic<bool> any_flat = false, any_area = false;
  const std::size_t before = shape.triangles.size();
  loaders::for_ranges(before, [&](std::size_t begin, std::size_t end) {
    bool flat_here = false, area_here = false;
    for (std::size_t i = begin; i < end; ++i) {
      auto& t = shape.triangles[i];
      const Vec3d face = face_vector(shape, t);
      const bool area = has_area(t, face);
      flat_here |= !area;
      area_here |= area;
      if (!given) continue;
      Vec3d sum;
      for (const std::uint32_t v : t) sum += Vec3d(shape.normals[v]);
      if (dot(sum, face) < 0) std::swap(t[1], t[2]);
    }
    if (flat_here) any_flat = true;
    if (area_here) any_area = true;
  });
  if (!any_area) {
    Shape empty;
    empty.dropped_count = shape.dropped_count + before;
    empty.positions = std::move(shape.positions);  // where it would be
    return empty;
  }
  if (any_flat) {
    for (loaders::MeshAttribute& attribute : mesh.attributes) {
      if (!attribute.of_faces()) continue;
      std::size_t kept = 0;
      for (std::size_t i = 0; i < before; ++i)
        if (has_area(shape, shape.triangles[i])) attribute.values[kept++] = attribute.values[i];
      attribute.values.resize(kept);
    }
    shape.triangles.erase(std::remove_if(shape.triangles.begin(), shape.triangles.end(),
                                         [&](const auto& t) { return !has_area(shape, t); }),
                          shape.triangles.end());
  }
  shape.dropped_count += before - shape.triangles.size();
  shape.attributes = std::move(mesh.attributes);
  if (smooth && !all_known) {
    std::vector<bool> known(shape.positions.size(), false);
    for (std::size_t i = 0; given && i < known.size(); ++i) known[i] = !(shape.normals[i] == Vec3{});
    complete_normals(shape, known);
  }
  if (flip_normals) {
    swap_corners(shape.triangles);
    for (Vec3& n : shape.normals) n = -n;
  }
  return shape;
}

}  // namespace candela::scene
