// Light subpaths of a whole iteration, kept in a compact form: what a vertex needs to be connected is made
// again, bsdf included, for the one path that an eye path connects to.
#pragma once

#include <cstdint>
#include <vector>

#include "worker/transport/subpath.h"

namespace candela::transport {

// A vertex that connects.
struct LightVertex {
  explicit LightVertex(const Vertex& v)
      : hit(v.hit),
        wo(v.wo),
        throughput(v.throughput),
        arrival(v.arrival),
        mis(v.mis),
        edges(v.edges),
        medium(v.medium),
        kind(v.kind) {}

  SurfaceHit hit;
  Vec3 wo;
  Spectrum throughput;
  float arrival;
  MisBlock mis;
  std::uint32_t edges;
  std::uint32_t medium;
  Vertex::Kind kind;
};

// Of one chunk of light paths, in their order.
class LightVertexBuffer {
 public:
  void clear() {
    vertices_.clear();
    ends_.clear();
  }
  void keep(const Vertex& v) { vertices_.emplace_back(v); }
  // Once after each path's vertices.
  void end_path() { ends_.push_back(static_cast<std::uint32_t>(vertices_.size())); }

  // The vertices of the chunk's path, those with fewer than `below` edges, ready to be connected.
  void load(const scene::Scene& scene, std::uint64_t path, std::uint32_t below, Subpath& out) const {
    out.clear();
    for (std::uint32_t i = path == 0 ? 0 : ends_[path - 1]; i < ends_[path]; ++i) {
      const LightVertex& kept = vertices_[i];
      if (kept.edges >= below) continue;
      Subpath::Slot& slot = out.next();
      Vertex& v = slot.vertex;
      v.kind = kept.kind;
      v.connects = true;
      v.hit = kept.hit;
      v.wo = kept.wo;
      v.throughput = kept.throughput;
      v.arrival = kept.arrival;
      v.mis = kept.mis;
      v.edges = kept.edges;
      v.medium = kept.medium;
      if (v.kind == Vertex::Kind::surface) {
        slot.arena.clear();
        v.closure = scene.closure(v.hit, v.hit.shading.to_local(v.wo), slot.arena);
      }
      out.keep();
    }
  }

  std::uint64_t bytes() const {
    return vertices_.capacity() * sizeof(LightVertex) + ends_.capacity() * sizeof(std::uint32_t);
  }

 private:
  std::vector<LightVertex> vertices_;
  std::vector<std::uint32_t> ends_;
};

}  // namespace candela::transport
