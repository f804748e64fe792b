// Light paths that are kept for eye paths, with edits that select by more of the path than the vertex
// (scene/bsdfs/path_edited.h).
#pragma once

#include <vector>

#include "worker/estimators/light_store.h"
#include "worker/scene/bsdfs/edited_arrivals.h"

namespace candela::estimators {

// For light paths that leave nothing but splats.
struct EditedNoStore : NoStore {
  static constexpr bool kEdits = true;
  static constexpr bool kKeeps = false;

  template <class Block>
  static void keep(const scene::Scene& /*scene*/, const transport::Vertex<Block>& /*v*/, bool /*last*/,
                   bool /*by_specular*/, film::SampleCounts& /*sample_counts*/,
                   const transport::ChannelStates* /*states*/, const scene::EditedWalk& /*walk*/) {}
};

// Facts of the walks of one chunk, by the numbers of the photons and of the vertices that its store keeps.
struct EditedChunk {
  scene::EditedArrivals surface, medium, vertices;

  void clear() {
    surface.clear();
    medium.clear();
    vertices.clear();
  }
};

// The store of one chunk, and what goes with it.
template <class Block>
struct EditedLightStore {
  static constexpr bool kEdits = true;
  static constexpr bool kKeeps = true;
  using Observer = transport::NoObserver;
  static Observer observer() { return {}; }
  template <class Walk>
  static void crossed(const Walk& /*walk*/, const transport::ChannelStates* /*states*/) {}

  LightStore<Block>& store;
  EditedChunk& chunk;

  // As LightStore; walk: at v.
  void keep(const scene::Scene& scene, const transport::Vertex<Block>& v, bool last, bool by_specular,
            film::SampleCounts& sample_counts, const transport::ChannelStates* states,
            const scene::EditedWalk& walk) {
    const std::size_t surface = store.surface.size(), medium = store.medium.size();
    store.keep(scene, v, last, by_specular, sample_counts, states);
    if (store.surface.size() > surface) chunk.surface.keep(walk);
    if (store.medium.size() > medium) chunk.medium.keep(walk);
    if (store.keeping.vertices && !last) chunk.vertices.keep(walk);
  }
  void end_path() { store.end_path(); }
};

// Facts of the walks of all chunks of an iteration.
struct EditedLight {
  std::vector<EditedChunk> chunks;
  scene::EditedArrivals surface, medium;  // by the number of the photon of a map

  // After the light paths.
  void join() {
    surface.clear();
    medium.clear();
    for (const EditedChunk& chunk : chunks) {
      surface.add(chunk.surface);
      medium.add(chunk.medium);
    }
  }
};

}  // namespace candela::estimators
