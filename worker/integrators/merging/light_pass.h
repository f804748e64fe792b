// The light paths of one iteration: their splats go to the film, their vertices into buffers, one for each
// chunk of paths, to be joined in the order of the chunks.
#pragma once

#include <cstdint>
#include <vector>

#include "worker/integrators/light_paths.h"
#include "worker/transport/light_vertices.h"
#include "worker/transport/photon_map.h"
#include "worker/transport/splat.h"

namespace candela::integrators::merging {

struct LightPass {
  std::uint64_t paths = 1;  // per iteration
  transport::WalkRules rules;
  transport::MisFactors factors;
  transport::MergeFactors eta;
  bool light_image = false, hit_lens = false;
  bool keep_vertices = false, surface_photons = false, medium_photons = false;
  bool caustics_only = false;  // of photons, those that a specular vertex sent: no other is kept
};

struct LightChunk {
  transport::PhotonBuffer surface, medium;
  transport::LightVertexBuffer vertices;
  void clear() {
    surface.clear();
    medium.clear();
    vertices.clear();
  }
};

// One light path.
template <transport::Between kBetween, class Heuristic>
void trace_light_path(const LightPass& pass, const scene::Scene& scene, const transport::Splatter& splatter,
                      samplers::Sampler& sampler, LightChunk& out, film::Tallies& tallies) {
  using namespace transport;
  using LightWalk = Walk<TransportMode::importance, kBetween, Heuristic>;
  const ConnectContext connect{scene, pass.factors, pass.rules, tallies};
  const auto each = static_cast<float>(1 / static_cast<double>(pass.paths));
  LightWalk walk(scene, pass.rules, pass.factors, sampler, tallies);
  if (!walk.start_light()) return;
  Vertex v;
  scene::ClosureArena arena;
  FilmPosition film;
  Contribution light;
  bool by_specular = false;
  for (std::uint64_t key = sampler.sample_key();; key = rng::combine(key, 1)) {
    const auto event = walk.advance(v, arena);
    if (pass.hit_lens && walk.lens().met) {
      light = hit_lens<Heuristic>(connect, walk, pass.eta, film);
      if (light.weight > 0) splatter.splat(0, film, light.weighted() * each, rng::combine(key, 2), tallies);
    }
    if (event != LightWalk::Event::vertex) return;
    if (v.connects) {
      const bool surface = v.kind == Vertex::Kind::surface;
      if ((surface ? pass.surface_photons : pass.medium_photons) && (by_specular || !pass.caustics_only)) {
        if (!(surface ? out.surface : out.medium).keep(scene, v))
          ++tallies.rejected[static_cast<std::size_t>(film::RejectCause::not_a_number)];
      }
      // The lens has one edge to come, and a connection to the eye's first vertex two.
      if (pass.keep_vertices && v.edges < pass.rules.max_edges) out.vertices.keep(v);
      if (pass.light_image && connect_lens<kBetween, Heuristic>(connect, sampler, walk.block(),
                                                                walk.stratified(), v, pass.eta, film, light))
        splatter.splat(0, film, light.weighted() * each, rng::combine(key, 3), tallies);
    }
    const auto step = walk.scatter(v);
    if (step == LightWalk::Step::ended) return;
    if (step == LightWalk::Step::scattered) by_specular = v.left_by_delta;
  }
}

// All of iteration `index` of the half. chunks: resized to light_chunk_count(pass.paths).
template <transport::Between kBetween, class Heuristic>
Result<void> run_light_pass(const LightPass& pass, const UnitContext& context, std::uint32_t half,
                            std::uint64_t index, std::vector<LightChunk>& chunks, film::UnitFilm& film,
                            const RunContext& run, ProgressSpan span) {
  chunks.resize(light_chunk_count(pass.paths));
  const transport::Splatter splatter(context.filter, film, context.width, context.height);
  return for_each_light_chunk(
      pass.paths, film, run,
      [&](std::uint64_t begin, std::uint64_t end, film::Tallies& tallies) {
        LightChunk& chunk = chunks[begin / kLightChunk];
        chunk.clear();
        samplers::Sampler sampler(context.sampler, context.seed);
        for (std::uint64_t path = begin; path < end; ++path) {
          sampler.start_light(half, index, path);
          trace_light_path<kBetween, Heuristic>(pass, context.scene, splatter, sampler, chunk, tallies);
          if (pass.keep_vertices) chunk.vertices.end_path();
        }
        tallies.light_paths += end - begin;
      },
      span);
}

// Builds a map of the chunks' photons.
inline Result<void> build_photon_map(const std::vector<LightChunk>& chunks,
                                     transport::PhotonBuffer LightChunk::*buffer, float radius,
                                     unsigned threads, transport::PhotonMap& map) {
  std::vector<const transport::PhotonBuffer*> buffers;
  buffers.reserve(chunks.size());
  for (const LightChunk& chunk : chunks) buffers.push_back(&(chunk.*buffer));
  return map.build(buffers, radius, threads);
}

}  // namespace candela::integrators::merging
