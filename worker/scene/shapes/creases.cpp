#include "worker/scene/shapes/creases.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <numeric>
#include <tuple>
#include <vector>

#include "common/base/work_monitor.h"
#include "worker/core/math.h"

namespace candela::scene {
namespace {

Vec3d face_normal(const loaders::Mesh& mesh, const Transform& to_world, std::size_t face) {
  const auto& t = mesh.triangles[face];
  const Vec3d a = to_world.point(Vec3d(mesh.positions[t[0]]));
  const Vec3d n =
      cross(to_world.point(Vec3d(mesh.positions[t[1]])) - a, to_world.point(Vec3d(mesh.positions[t[2]])) - a);
  const double l = length(n);
  return l > 0 && std::isfinite(l) ? n / l : Vec3d{};
}

}  // namespace

loaders::Mesh split_at_creases(loaders::Mesh mesh, const Transform& to_world, double max_degrees,
                               const std::vector<loaders::MeshPart>& parts) {
  float sine = 0, cosine = 0;
  math::sincosf(static_cast<float>(max_degrees * (std::numbers::pi / 180)), sine, cosine);
  const double threshold = static_cast<double>(cosine) - 1e-6;
  std::vector<Vec3d> normals(mesh.triangles.size());
  for (std::size_t i = 0; i < normals.size(); ++i) normals[i] = face_normal(mesh, to_world, i);

  // Corners of faces, those of one place next to each other, and there in the order of the faces.
  std::vector<std::size_t> corners(3 * mesh.triangles.size());
  std::iota(corners.begin(), corners.end(), std::size_t{0});
  const auto part = [&](std::size_t corner) {
    const auto after = std::upper_bound(
        parts.begin(), parts.end(), corner / 3,
        [](std::size_t triangle, const loaders::MeshPart& other) { return triangle < other.first_triangle; });
    return after - parts.begin();
  };
  const auto place = [&](std::size_t corner) {
    const std::uint32_t v = mesh.triangles[corner / 3][corner % 3];
    const Vec3 p = mesh.positions[v];
    const Vec2 uv = mesh.uvs.empty() ? Vec2{} : mesh.uvs[v];
    return std::tuple(p.x, p.y, p.z, uv.x, uv.y);
  };
  // Below 0: a comes before b; 0: they have one place and one value of each attribute.
  const auto compare = [&](std::size_t a, std::size_t b) {
    const auto first = place(a), second = place(b);
    if (first != second) return first < second ? -1 : 1;
    if (parts.size() > 1 && part(a) != part(b)) return part(a) < part(b) ? -1 : 1;
    for (const loaders::MeshAttribute& attribute : mesh.attributes) {
      if (attribute.of_faces()) continue;
      const Spectrum p = attribute.values[mesh.triangles[a / 3][a % 3]],
                     q = attribute.values[mesh.triangles[b / 3][b % 3]];
      const auto of_a = std::tie(p.r, p.g, p.b), of_b = std::tie(q.r, q.g, q.b);
      if (of_a != of_b) return of_a < of_b ? -1 : 1;
    }
    return 0;
  };
  std::stable_sort(corners.begin(), corners.end(),
                   [&](std::size_t a, std::size_t b) { return compare(a, b) < 0; });

  loaders::Mesh split;
  split.dropped_face_count = mesh.dropped_face_count;
  split.triangles.resize(mesh.triangles.size());
  for (const loaders::MeshAttribute& attribute : mesh.attributes)
    split.attributes.push_back(attribute.of_faces() ? attribute : loaders::MeshAttribute{attribute.name, {}});
  std::vector<bool> taken(corners.size());
  for (std::size_t begin = 0, end = 0; begin < corners.size(); begin = end) {
    work_step(begin);
    while (end < corners.size() && compare(corners[end], corners[begin]) == 0) ++end;
    for (std::size_t i = begin; i < end; ++i) {
      if (taken[corners[i]]) continue;
      const auto vertex = static_cast<std::uint32_t>(split.positions.size());
      const std::uint32_t old = mesh.triangles[corners[i] / 3][corners[i] % 3];
      split.positions.push_back(mesh.positions[old]);
      if (!mesh.uvs.empty()) split.uvs.push_back(mesh.uvs[old]);
      for (std::size_t a = 0; a < mesh.attributes.size(); ++a)
        if (!mesh.attributes[a].of_faces())
          split.attributes[a].values.push_back(mesh.attributes[a].values[old]);
      for (std::size_t k = i; k < end; ++k) {
        const std::size_t corner = corners[k];
        if (taken[corner] || (k != i && dot(normals[corners[i] / 3], normals[corner / 3]) < threshold))
          continue;
        taken[corner] = true;
        split.triangles[corner / 3][corner % 3] = vertex;
      }
    }
  }
  return split;
}

}  // namespace candela::scene
