#include "worker/scene/shapes/level_set.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <unordered_map>

#include "common/base/work_monitor.h"

namespace candela::scene {
namespace {

constexpr std::uint64_t kTriangleBudget = 1'000'000;  // that finer cells may make
constexpr std::uint32_t kFinest = 4;

class Polygonizer {
 public:
  explicit Polygonizer(const loaders::VolumeData& field) : field_(field) {}

  loaders::Mesh run() {
    std::uint64_t crossed = 0;
    for_crossed_cells([&](std::uint32_t, std::uint32_t, std::uint32_t) { ++crossed; });
    // A crossed cell makes some 8 triangles for each square of its face.
    while (fine_ < kFinest && crossed * 8 * (fine_ + 1) * (fine_ + 1) <= kTriangleBudget) ++fine_;
    for_crossed_cells([&](std::uint32_t x, std::uint32_t y, std::uint32_t z) { polygonize(x, y, z); });
    return std::move(mesh_);
  }

 private:
  using Node = std::array<std::uint64_t, 3>;  // of the fine lattice

  double value(std::uint32_t x, std::uint32_t y, std::uint32_t z) const {
    const std::size_t i = (std::size_t{z} * field_.size[1] + y) * field_.size[0] + x;
    return static_cast<double>(field_.values[i]);
  }

  Vec3d cells() const {
    return {static_cast<double>(field_.size[0] - 1), static_cast<double>(field_.size[1] - 1),
            static_cast<double>(field_.size[2] - 1)};
  }

  // At a place in units of cells, within the grid.
  double at(Vec3d p) const {
    std::array<std::uint32_t, 3> cell{};
    std::array<double, 3> t{};
    for (int axis = 0; axis < 3; ++axis) {
      const auto k = static_cast<std::size_t>(axis);
      const double last = static_cast<double>(field_.size[k] - 1);
      const double place = std::clamp(p[axis], 0.0, last);
      cell[k] = static_cast<std::uint32_t>(std::min(std::floor(place), last - 1));
      t[k] = place - static_cast<double>(cell[k]);
    }
    double sum = 0;
    for (std::uint32_t corner = 0; corner < 8; ++corner) {
      const std::uint32_t dx = corner & 1, dy = corner >> 1 & 1, dz = corner >> 2;
      const double weight =
          (dx != 0 ? t[0] : 1 - t[0]) * (dy != 0 ? t[1] : 1 - t[1]) * (dz != 0 ? t[2] : 1 - t[2]);
      sum += weight * value(cell[0] + dx, cell[1] + dy, cell[2] + dz);
    }
    return sum;
  }

  // Inside of a cell the field is between the values at its corners.
  template <class F>
  void for_crossed_cells(const F& f) const {
    for (std::uint32_t z = 0; z + 1 < field_.size[2]; ++z)
      for (std::uint32_t y = 0; y + 1 < field_.size[1]; ++y) {
        work_step();
        for (std::uint32_t x = 0; x + 1 < field_.size[0]; ++x) {
          int inside = 0;
          for (std::uint32_t c = 0; c < 8; ++c)
            inside += value(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2)) < 0;
          if (inside != 0 && inside != 8) f(x, y, z);
        }
      }
  }

  Vec3d place(const Node& node) const {
    const double fine = fine_;
    return {static_cast<double>(node[0]) / fine, static_cast<double>(node[1]) / fine,
            static_cast<double>(node[2]) / fine};
  }

  // Unit, out of the field's inside, in [0, 1]^3.
  Vec3 normal_at(Vec3d p) const {
    const auto slope = [&](Vec3d half, double cells) { return (at(p + half) - at(p - half)) * cells; };
    const Vec3d size = cells();
    const Vec3d gradient = {slope({0.5, 0, 0}, size.x), slope({0, 0.5, 0}, size.y),
                            slope({0, 0, 0.5}, size.z)};
    const double l = length(gradient);
    return l > 0 ? Vec3(gradient / l) : Vec3{};
  }

  std::uint64_t key(const Node& node) const {
    const std::uint64_t nx = std::uint64_t{field_.size[0] - 1} * fine_ + 1,
                        ny = std::uint64_t{field_.size[1] - 1} * fine_ + 1;
    return (node[2] * ny + node[1]) * nx + node[0];
  }

  // The vertex on the edge from a (inside) to b, shared by all tetrahedra around it.
  std::uint32_t vertex(const Node& a, const Node& b, double value_a, double value_b) {
    const auto index = static_cast<std::uint32_t>(mesh_.positions.size());
    const auto [entry, is_new] = vertices_[key(a)].try_emplace(key(b), index);
    if (!is_new) return entry->second;
    const double t = value_a / (value_a - value_b);
    const Vec3d p = place(a) * (1 - t) + place(b) * t;
    const Vec3d size = cells();
    mesh_.positions.push_back(Vec3(Vec3d{p.x / size.x, p.y / size.y, p.z / size.z}));
    mesh_.normals.push_back(normal_at(p));
    mesh_.uvs.push_back({});
    return index;
  }

  void tetrahedron(const std::array<Node, 4>& nodes, const std::array<double, 4>& values) {
    std::array<std::size_t, 4> in{}, out{};
    std::size_t in_count = 0, out_count = 0;
    for (std::size_t i = 0; i < 4; ++i) (values[i] < 0 ? in[in_count++] : out[out_count++]) = i;
    if (in_count == 0 || out_count == 0) return;
    const auto cut = [&](std::size_t i, std::size_t o) {
      return vertex(nodes[i], nodes[o], values[i], values[o]);
    };
    if (in_count == 2) {
      const std::uint32_t a = cut(in[0], out[0]), b = cut(in[0], out[1]), c = cut(in[1], out[1]),
                          d = cut(in[1], out[0]);
      mesh_.triangles.push_back({a, b, c});
      mesh_.triangles.push_back({a, c, d});
    } else if (in_count == 1) {
      mesh_.triangles.push_back({cut(in[0], out[0]), cut(in[0], out[1]), cut(in[0], out[2])});
    } else {
      mesh_.triangles.push_back({cut(in[0], out[0]), cut(in[1], out[0]), cut(in[2], out[0])});
    }
  }

  // Six tetrahedra around the diagonal of each fine cell: neighbors agree on their common faces.
  void polygonize(std::uint32_t x, std::uint32_t y, std::uint32_t z) {
    static constexpr std::array<std::array<std::uint32_t, 4>, 6> kCorners = {
        {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7}, {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}}};
    for (std::uint32_t k = 0; k < fine_; ++k)
      for (std::uint32_t j = 0; j < fine_; ++j)
        for (std::uint32_t i = 0; i < fine_; ++i) {
          std::array<Node, 8> nodes;
          std::array<double, 8> values{};
          for (std::uint32_t c = 0; c < 8; ++c) {
            nodes[c] = {std::uint64_t{x} * fine_ + i + (c & 1), std::uint64_t{y} * fine_ + j + (c >> 1 & 1),
                        std::uint64_t{z} * fine_ + k + (c >> 2)};
            values[c] = at(place(nodes[c]));
          }
          for (const auto& corners : kCorners)
            tetrahedron({nodes[corners[0]], nodes[corners[1]], nodes[corners[2]], nodes[corners[3]]},
                        {values[corners[0]], values[corners[1]], values[corners[2]], values[corners[3]]});
        }
  }

  const loaders::VolumeData& field_;
  std::uint32_t fine_ = 1;
  loaders::Mesh mesh_;
  std::unordered_map<std::uint64_t, std::unordered_map<std::uint64_t, std::uint32_t>> vertices_;
};

}  // namespace

Result<loaders::Mesh> level_set(const loaders::VolumeData& field, const std::string& name) {
  if (field.channels != 1) return input_error("a distance field has one channel").at(name, 0);
  for (const std::uint32_t size : field.size)
    if (size < 2) return input_error("a distance field has two values or more along each axis").at(name, 0);
  loaders::Mesh mesh = Polygonizer(field).run();
  if (mesh.triangles.empty()) return input_error("the distance field is zero nowhere").at(name, 0);
  return mesh;
}

}  // namespace candela::scene
