// Meshes: from object space as the file has it to triangles in world space.
#include <cmath>

#include "worker/core/math.h"
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
bool has_area(const Shape& shape, const std::array<std::uint32_t, 3>& t) {
  if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) return false;
  return length_squared(face_vector(shape, t)) > 1e-60;
}

double angle_between(Vec3d a, Vec3d b) {
  return static_cast<double>(math::atan2f(static_cast<float>(length(cross(a, b)) / (length(a) * length(b))),
                                          static_cast<float>(dot(a, b) / (length(a) * length(b)))));
}

// Thuermer and Wuethrich 1998: normals of faces around a vertex weighted by their angle there. Only for
// vertices that have none; false marks them.
void complete_normals(Shape& shape, const std::vector<bool>& known) {
  std::vector<Vec3d> sums(shape.positions.size());
  for (const auto& t : shape.triangles) {
    const Vec3d n = normalize(face_vector(shape, t));
    for (std::size_t k = 0; k < 3; ++k) {
      if (known[t[k]]) continue;
      const Vec3d p(shape.positions[t[k]]);
      sums[t[k]] += n * angle_between(Vec3d(shape.positions[t[(k + 1) % 3]]) - p,
                                      Vec3d(shape.positions[t[(k + 2) % 3]]) - p);
    }
  }
  for (std::size_t i = 0; i < sums.size(); ++i) {
    if (known[i]) continue;
    const double l = length(sums[i]);
    // Faces that cancel each other out leave no direction: a hit falls back on the face's normal there.
    shape.normals[i] = l > 1e-12 ? Vec3(sums[i] / l) : Vec3{};
  }
}

}  // namespace

Result<Shape> shape_from_mesh(loaders::Mesh mesh, const Transform& to_world, bool face_normals,
                              bool flip_normals, const std::string& name) {
  Shape shape;
  shape.dropped_count = mesh.dropped_face_count;
  shape.positions.resize(mesh.positions.size());
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const Vec3d p = to_world.point(Vec3d(mesh.positions[i]));
    if (!(std::abs(p.x) <= kLargestCoordinate && std::abs(p.y) <= kLargestCoordinate &&
          std::abs(p.z) <= kLargestCoordinate)) {
      return input_error("vertex " + std::to_string(i) + " lies beyond 1e18 in the scene after to_world")
          .at(name, 0);
    }
    shape.positions[i] = Vec3(p);
  }
  shape.uvs = std::move(mesh.uvs);
  shape.triangles = std::move(mesh.triangles);
  const std::size_t before = shape.triangles.size();
  std::erase_if(shape.triangles, [&](const auto& t) { return !has_area(shape, t); });
  shape.dropped_count += before - shape.triangles.size();
  if (shape.triangles.empty()) return input_error("no face of the mesh has an area").at(name, 0);

  if (!face_normals && !mesh.face_normals) {
    std::vector<bool> known(shape.positions.size(), false);
    shape.normals.resize(shape.positions.size());
    bool all_known = !mesh.normals.empty();
    for (std::size_t i = 0; i < mesh.normals.size(); ++i) {
      const Vec3d n = to_world.normal(Vec3d(mesh.normals[i]));
      const double l = length(n);
      known[i] = l > 0 && std::isfinite(l);
      all_known = all_known && known[i];
      if (known[i]) shape.normals[i] = Vec3(n / l);
    }
    if (!mesh.normals.empty()) {
      for (auto& t : shape.triangles) {
        Vec3d sum;
        for (const std::uint32_t v : t) sum += known[v] ? Vec3d(shape.normals[v]) : Vec3d();
        if (dot(sum, face_vector(shape, t)) < 0) std::swap(t[1], t[2]);
      }
    }
    if (!all_known) complete_normals(shape, known);
  }
  if (flip_normals) {
    for (auto& t : shape.triangles) std::swap(t[1], t[2]);
    for (Vec3& n : shape.normals) n = -n;
  }
  return shape;
}

}  // namespace candela::scene
