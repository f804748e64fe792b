// Weights are those of [Loop 1987] with Warren's beta, as in pbrt.
#include "worker/loaders/loop_subdivision.h"

#include <algorithm>
#include <tuple>
#include <utility>

#include "common/base/work_monitor.h"

namespace candela::loaders {
namespace {

// Two vertices, the smaller first, of a triangle whose third vertex is opposite.
struct Edge {
  std::uint32_t a = 0, b = 0, opposite = 0;
  std::uint32_t triangle = 0, side = 0;
};

struct Ring {
  Vec3d sum;  // of the neighbors inside, or of the two along the border
  std::uint32_t count = 0;
  bool border = false;
};

struct Topology {
  std::vector<Edge> edges;  // sorted: those of one edge follow each other
  std::vector<Ring> rings;  // by vertex
};

bool same(const Edge& x, const Edge& y) {
  return x.a == y.a && x.b == y.b;
}

// The end of the run of entries of the edge at i.
std::size_t run_end(const std::vector<Edge>& edges, std::size_t i) {
  std::size_t end = i + 1;
  while (end < edges.size() && same(edges[end], edges[i])) ++end;
  return end;
}

Topology topology_of(const Mesh& mesh) {
  Topology t;
  t.edges.reserve(3 * mesh.triangles.size());
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    work_step(i);
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t from = mesh.triangles[i][k], to = mesh.triangles[i][(k + 1) % 3];
      t.edges.push_back({std::min(from, to), std::max(from, to), mesh.triangles[i][(k + 2) % 3],
                         static_cast<std::uint32_t>(i), static_cast<std::uint32_t>(k)});
    }
  }
  work_step();
  std::sort(t.edges.begin(), t.edges.end(), [](const Edge& x, const Edge& y) {
    return std::tie(x.a, x.b, x.triangle, x.side) < std::tie(y.a, y.b, y.triangle, y.side);
  });
  t.rings.resize(mesh.positions.size());
  for (std::size_t i = 0; i < t.edges.size(); i = run_end(t.edges, i))
    if (run_end(t.edges, i) - i != 2) t.rings[t.edges[i].a].border = t.rings[t.edges[i].b].border = true;
  for (std::size_t i = 0; i < t.edges.size(); i = run_end(t.edges, i)) {
    const bool border = run_end(t.edges, i) - i != 2;
    for (const auto& [v, other] :
         {std::pair(t.edges[i].a, t.edges[i].b), std::pair(t.edges[i].b, t.edges[i].a)}) {
      if (t.rings[v].border && !border) continue;
      t.rings[v].sum += Vec3d(mesh.positions[other]);
      ++t.rings[v].count;
    }
  }
  return t;
}

double beta(std::uint32_t valence) {
  return valence == 3 ? 3.0 / 16 : 3.0 / (8.0 * valence);
}

// A vertex and its neighbors with a weight for each neighbor.
Vec3 weighted(Vec3 p, const Ring& ring, double weight) {
  return Vec3(Vec3d(p) * (1 - ring.count * weight) + ring.sum * weight);
}

Mesh subdivide(const Mesh& mesh) {
  const Topology t = topology_of(mesh);
  Mesh out;
  out.positions.resize(mesh.positions.size());
  for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
    const Ring& ring = t.rings[v];
    const double weight = ring.count == 0 ? 0 : ring.border ? 1.0 / 8 : beta(ring.count);
    out.positions[v] = weighted(mesh.positions[v], ring, weight);
  }
  std::vector<std::array<std::uint32_t, 3>> middles(mesh.triangles.size());
  for (std::size_t i = 0; i < t.edges.size();) {
    work_step(i);
    const std::size_t end = run_end(t.edges, i);
    const Vec3d ends = Vec3d(mesh.positions[t.edges[i].a]) + Vec3d(mesh.positions[t.edges[i].b]);
    Vec3d middle = ends * 0.5;
    if (end - i == 2)
      middle = ends * (3.0 / 8) +
               (Vec3d(mesh.positions[t.edges[i].opposite]) + Vec3d(mesh.positions[t.edges[i + 1].opposite])) *
                   (1.0 / 8);
    const auto index = static_cast<std::uint32_t>(out.positions.size());
    out.positions.push_back(Vec3(middle));
    for (; i < end; ++i) middles[t.edges[i].triangle][t.edges[i].side] = index;
  }
  out.triangles.reserve(4 * mesh.triangles.size());
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    work_step(i);
    const auto& [a, b, c] = mesh.triangles[i];
    const auto& [ab, bc, ca] = middles[i];
    out.triangles.push_back({a, ab, ca});
    out.triangles.push_back({ab, b, bc});
    out.triangles.push_back({ca, bc, c});
    out.triangles.push_back({ab, bc, ca});
  }
  return out;
}

}  // namespace

Mesh loop_subdivision(Mesh mesh, int levels) {
  mesh.normals.clear();
  mesh.uvs.clear();
  for (int level = 0; level < levels; ++level) mesh = subdivide(mesh);
  const Topology t = topology_of(mesh);
  std::vector<Vec3> limit(mesh.positions.size());
  for (std::size_t v = 0; v < limit.size(); ++v) {
    const Ring& ring = t.rings[v];
    double weight = 0;
    if (ring.count > 0) weight = ring.border ? 1.0 / 5 : 1 / (ring.count + 3 / (8 * beta(ring.count)));
    limit[v] = weighted(mesh.positions[v], ring, weight);
  }
  mesh.positions = std::move(limit);
  return mesh;
}

}  // namespace candela::loaders
