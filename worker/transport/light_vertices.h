// Compact storage of all light subpaths of an iteration. BSDFs are evaluated again by load(), for the one
// subpath that an eye path connects to.
#pragma once

#include <cstdint>
#include <vector>

#include "worker/scene/bsdfs/edited.h"
#include "worker/transport/letters/path_letters.h"
#include "worker/transport/subpath.h"

namespace candela::transport {

// A connectible vertex. Block: that of a policy of weights (mis/).
template <class Block>
struct LightVertex {
  explicit LightVertex(const Vertex<Block>& v)
      : hit(v.hit),
        wo(v.wo),
        throughput(v.throughput),
        arrival(v.arrival),
        survival(v.survival),
        mis(v.mis),
        edges(v.edges),
        medium(v.medium),
        kind(v.kind) {}

  SurfaceHit hit;
  Vec3 wo;
  Spectrum throughput;
  float arrival, survival;
  [[no_unique_address]] Block mis;
  std::uint32_t edges;
  std::uint32_t medium;
  VertexKind kind;
};

struct NothingOnArrival {
  void operator()(std::uint32_t /*i*/, std::uint32_t /*kept*/, ScatterPoint& /*v*/) const {}
};

// Vertices of one chunk of light paths, in their order.
template <class Block>
class LightVertexBuffer {
 public:
  void clear() {
    vertices_.clear();
    states_.clear();
    ends_.clear();
  }
  // states: of the letters before v, for all vertices or none.
  void keep(const Vertex<Block>& v, const ChannelStates* states = nullptr) {
    vertices_.emplace_back(v);
    if (states != nullptr) states_.push_back(*states);
  }
  // Once after each path's vertices.
  void end_path() { ends_.push_back(static_cast<std::uint32_t>(vertices_.size())); }

  // The vertices of the chunk's path, those with fewer than `below` edges, ready to be connected. states:
  // gets theirs, where they were kept. arrive(i, kept, v): v is the i-th that is loaded, number `kept` of the
  // buffer, and has its closure.
  template <class Arrive = NothingOnArrival>
  void load(const scene::Scene& scene, std::uint64_t path, std::uint32_t below, Subpath<Block>& out,
            std::vector<ChannelStates>* states = nullptr, const Arrive& arrive = {}) const {
    out.clear();
    if (states != nullptr) states->clear();
    for (std::uint32_t i = path == 0 ? 0 : ends_[path - 1]; i < ends_[path]; ++i) {
      const LightVertex<Block>& kept = vertices_[i];
      if (kept.edges >= below) continue;
      auto& slot = out.next();
      Vertex<Block>& v = slot.vertex;
      v.kind = kept.kind;
      v.connectible = true;
      v.hit = kept.hit;
      v.wo = kept.wo;
      v.throughput = kept.throughput;
      v.arrival = kept.arrival;
      v.survival = kept.survival;
      v.mis = kept.mis;
      v.edges = kept.edges;
      v.medium = kept.medium;
      if (v.on_surface()) {
        slot.arena.clear();
        v.closure = scene.closure(v.hit, v.hit.shading.to_local(v.wo), slot.arena);
      } else {
        const scene::Medium& around = scene.medium(v.medium);
        v.turned = around.edits() != nullptr &&
                   scene::edited_phase(*around.edits(), around.phase(), v.hit.p, slot.arena, v.closure);
      }
      arrive(out.size(), i, v);
      out.add();
      if (states != nullptr) states->push_back(states_[i]);
    }
  }

  std::uint64_t bytes() const {
    return vertices_.capacity() * sizeof(LightVertex<Block>) + states_.capacity() * sizeof(ChannelStates) +
           ends_.capacity() * sizeof(std::uint32_t);
  }

 private:
  std::vector<LightVertex<Block>> vertices_;
  std::vector<ChannelStates> states_;
  std::vector<std::uint32_t> ends_;
};

}  // namespace candela::transport
