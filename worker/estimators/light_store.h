// Photons and vertices that the light paths of an iteration leave for eye paths, in chunks of light paths.
#pragma once

#include <cstdint>
#include <vector>

#include "common/film/counts.h"
#include "worker/transport/light_vertices.h"
#include "worker/transport/photon_map.h"
#include "worker/transport/segments.h"

namespace candela::estimators {

// Paths of one chunk. Large enough that taking one costs nothing, small enough that some thousands of paths
// keep all threads busy.
inline constexpr std::uint64_t kLightChunk = 1024;

// Selects the vertices of light paths that are kept.
struct LightKeeping {
  bool vertices = false, surface_photons = false, medium_photons = false;
  bool caustics_only = false;  // only photons that arrive from a specular vertex
  bool paths_of_photons = false;
  bool survivals = false;  // of photons in media
};

// For light paths that leave nothing but splats. Stores may observe walks (segments.h); crossed() comes after
// each of their steps. A store with `static constexpr bool kEdits = true` makes the walks of LightTracing
// those of a scene with edits that select by more of the path than the vertex (edited_light_store.h).
struct NoStore {
  using Observer = transport::NoObserver;
  static Observer observer() { return {}; }
  template <class Walk>
  static void crossed(const Walk& /*walk*/, const transport::ChannelStates* /*states*/) {}
  template <class Block>
  static void keep(const scene::Scene& /*scene*/, const transport::Vertex<Block>& /*v*/, bool /*last*/,
                   bool /*by_specular*/, film::SampleCounts& /*sample_counts*/,
                   const transport::ChannelStates* /*states*/) {}
};

// The store of one chunk, in the order of its paths.
template <class Block>
struct LightStore {
  using Observer = transport::NoObserver;
  static Observer observer() { return {}; }
  template <class Walk>
  static void crossed(const Walk& /*walk*/, const transport::ChannelStates* /*states*/) {}

  LightKeeping keeping;
  transport::PhotonBuffer<Block> surface, medium;
  transport::LightVertexBuffer<Block> vertices;

  void clear() {
    surface.clear();
    medium.clear();
    vertices.clear();
  }
  // v is connectible. last: no edge may come between it and the lens. by_specular: the vertex before was left
  // by a delta lobe. states: of the letters before v, for all vertices or none.
  void keep(const scene::Scene& scene, const transport::Vertex<Block>& v, bool last, bool by_specular,
            film::SampleCounts& sample_counts, const transport::ChannelStates* states = nullptr) {
    const bool photons = v.on_surface() ? keeping.surface_photons : keeping.medium_photons;
    if (photons && (by_specular || !keeping.caustics_only)) {
      const bool kept = v.on_surface() ? surface.keep(scene, v, false, states)
                                       : medium.keep(scene, v, keeping.survivals, states);
      if (!kept) ++sample_counts.rejected[static_cast<std::size_t>(film::RejectCause::not_a_number)];
    }
    if (keeping.vertices && !last) vertices.keep(v, states);
  }
  // Once after each path.
  void end_path() {
    if (keeping.vertices) vertices.end_path();
    if (keeping.paths_of_photons) {
      surface.end_path();
      medium.end_path();
    }
  }
};

// The vertices of light path `path` with fewer than `below` edges. arrive: as LightVertexBuffer::load().
template <class Block, class Arrive = transport::NothingOnArrival>
void load_light_path(const std::vector<LightStore<Block>>& chunks, const scene::Scene& scene,
                     std::uint64_t path, std::uint32_t below, transport::Subpath<Block>& out,
                     std::vector<transport::ChannelStates>* states = nullptr, const Arrive& arrive = {}) {
  chunks[path / kLightChunk].vertices.load(scene, path % kLightChunk, below, out, states, arrive);
}

}  // namespace candela::estimators
