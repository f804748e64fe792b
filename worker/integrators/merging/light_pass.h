// The light paths of one iteration over threads: their splats go to the film, what eye paths need of them
// into stores, one for each chunk of paths, to be joined in the order of the chunks.
#pragma once

#include <cstdint>
#include <type_traits>
#include <vector>

#include "worker/estimators/edited_light_store.h"
#include "worker/estimators/light_tracing.h"
#include "worker/integrators/light_paths.h"

namespace candela::integrators::merging {

template <class Block>
using LightChunks = std::vector<estimators::LightStore<Block>>;

// All of iteration `index` of the half. store_of(chunk) makes the chunk's store, empty, or refers to it: see
// LightTracing, which has image_layer too.
template <transport::EdgeContent kEdgeContent, class Mis, transport::EtaField Eta, class StoreOf>
Result<void> trace_light_paths(const UnitContext& context, const estimators::PathOptions& options,
                               const estimators::Techniques& techniques, const estimators::PathCounts& counts,
                               const Eta& eta, std::uint32_t half, std::uint64_t index,
                               const StoreOf& store_of, film::UnitFilm& film, const RunContext& run,
                               ProgressSpan span, std::uint32_t image_layer = 0) {
  const transport::Splatter splatter(context.filter, film, context.width, context.height,
                                     context.camera_units);
  return for_each_light_chunk(
      static_cast<std::uint64_t>(counts.light_paths), film, run,
      [&](std::uint64_t begin, std::uint64_t end, film::SampleCounts& sample_counts) {
        auto&& store = store_of(begin / kLightChunk);
        samplers::Sampler sampler(context.sampler, context.seed);
        estimators::LightTracing<kEdgeContent, Mis, std::remove_reference_t<decltype(store)>, Eta> light(
            context.scene, options, techniques, counts, eta, splatter, store, sample_counts, image_layer,
            context.letters);
        for (std::uint64_t path = begin; path < end; ++path) {
          if (path % 64 == 0 && run.stopped()) return;
          sampler.start_light(half, index, path);
          light(path, sampler);
          store.end_path();
        }
        sample_counts.light_paths += end - begin;
      },
      span);
}

// The same into chunks, which are resized to light_chunk_count(counts.light_paths).
template <transport::EdgeContent kEdgeContent, class Mis, transport::EtaField Eta>
Result<void> run_light_pass(const UnitContext& context, const estimators::PathOptions& options,
                            const estimators::Techniques& techniques, const estimators::PathCounts& counts,
                            const estimators::LightKeeping& keeping, const Eta& eta, std::uint32_t half,
                            std::uint64_t index, LightChunks<typename Mis::Block>& chunks,
                            film::UnitFilm& film, const RunContext& run, ProgressSpan span) {
  chunks.resize(light_chunk_count(static_cast<std::uint64_t>(counts.light_paths)));
  const auto store_of = [&](std::uint64_t chunk) -> auto& {
    chunks[chunk].keeping = keeping;
    chunks[chunk].clear();
    return chunks[chunk];
  };
  return trace_light_paths<kEdgeContent, Mis>(context, options, techniques, counts, eta, half, index,
                                              store_of, film, run, span);
}

// The same with edits that select by more of the path than the vertex.
template <transport::EdgeContent kEdgeContent, class Mis, transport::EtaField Eta>
Result<void> run_edited_light_pass(const UnitContext& context, const estimators::PathOptions& options,
                                   const estimators::Techniques& techniques,
                                   const estimators::PathCounts& counts, estimators::LightKeeping keeping,
                                   const Eta& eta, std::uint32_t half, std::uint64_t index,
                                   LightChunks<typename Mis::Block>& chunks, estimators::EditedLight& edits,
                                   film::UnitFilm& film, const RunContext& run, ProgressSpan span) {
  keeping.paths_of_photons = true;  // photons are known by their number
  chunks.resize(light_chunk_count(static_cast<std::uint64_t>(counts.light_paths)));
  edits.chunks.resize(chunks.size());
  const auto store_of = [&](std::uint64_t chunk) {
    chunks[chunk].keeping = keeping;
    chunks[chunk].clear();
    edits.chunks[chunk].clear();
    return estimators::EditedLightStore<typename Mis::Block>{chunks[chunk], edits.chunks[chunk]};
  };
  CANDELA_TRY((trace_light_paths<kEdgeContent, Mis>(context, options, techniques, counts, eta, half, index,
                                                    store_of, film, run, span)));
  edits.join();
  return {};
}

// Builds a map of the chunks' photons.
template <class Block>
Result<void> build_photon_map(const LightChunks<Block>& chunks,
                              transport::PhotonBuffer<Block> estimators::LightStore<Block>::*buffer,
                              float radius, unsigned threads, transport::PhotonMap<Block>& map) {
  std::vector<const transport::PhotonBuffer<Block>*> buffers;
  buffers.reserve(chunks.size());
  for (const auto& chunk : chunks) buffers.push_back(&(chunk.*buffer));
  return map.build(buffers, radius, threads);
}

}  // namespace candela::integrators::merging
