// The light paths of one iteration: independent ones, and the chains that spread the visible ones of them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "worker/integrators/light_paths.h"
#include "worker/integrators/mcppm/light_paths.h"
#include "worker/integrators/merging/light_pass.h"
#include "worker/mcmc/short_chain.h"

namespace candela::integrators::mcppm {

// One iteration, as its light paths see it.
struct PhotonPass {
  const UnitContext& context;
  const merging::IterationOptions& options;
  const estimators::PathCounts& counts;
  const GatherPlaces& places;
  std::uint32_t half;
  std::uint64_t index;

  std::uint64_t light_path_count() const { return static_cast<std::uint64_t>(counts.light_paths); }
  estimators::LightKeeping keeping() const {
    return {.surface_photons = options.techniques.merge_surface,
            .medium_photons = options.techniques.merge_medium,
            .caustics_only = options.caustics_only};
  }
  // Keys of independent light path number `path`, and of the mutations of chain number `chain`.
  std::uint64_t path_key(std::uint64_t path) const {
    return rng::key(context.seed, kPaths, half, index, path);
  }
  std::uint64_t chain_key(std::uint64_t chain) const {
    return rng::key(context.seed, kChains, half, index, chain);
  }

 private:
  static constexpr std::uint64_t kPaths = 0x6d637061746873ULL;     // "mcpaths"
  static constexpr std::uint64_t kChains = 0x6d63636861696e73ULL;  // "mcchains"
};

// The numbers of the visible ones among the independent light paths, in order.
template <transport::EdgeContent kEdgeContent>
Result<std::vector<std::uint64_t>> visible_paths(const PhotonPass& pass, film::UnitFilm& film,
                                                 const RunContext& run, ProgressSpan span) {
  std::vector<std::vector<std::uint64_t>> found(light_chunk_count(pass.light_path_count()));
  CANDELA_TRY(for_each_light_chunk(
      pass.light_path_count(), film, run,
      [&](std::uint64_t begin, std::uint64_t end, film::SampleCounts& sample_counts) {
        PhotonStore room{pass.keeping(), {}, {}, {}};
        LightPaths<kEdgeContent> paths(pass.context, pass.options, pass.counts, pass.places, room,
                                       sample_counts);
        mcmc::PrimaryState numbers({});
        for (std::uint64_t path = begin; path < end; ++path) {
          if (path % 64 == 0 && run.stopped()) return;
          numbers.start(pass.path_key(path));
          if (paths.visible(numbers)) found[begin / kLightChunk].push_back(path);
        }
        sample_counts.light_paths += end - begin;
      },
      span));
  std::vector<std::uint64_t> all;
  for (const auto& chunk : found) all.insert(all.end(), chunk.begin(), chunk.end());
  return all;
}

// Spreads each of these light paths over a chain. `photons` gets what the states of all chains leave, each
// photon with its weight times the number of light paths. Returns the number of accepted mutations.
template <transport::EdgeContent kEdgeContent>
Result<std::uint64_t> spread(const PhotonPass& pass, const std::vector<std::uint64_t>& visible,
                             std::uint64_t mutations, mcmc::StepSizes steps,
                             merging::LightChunks<Block>& photons, film::UnitFilm& film,
                             const RunContext& run, ProgressSpan span) {
  const std::uint64_t chains = visible.size();
  if (chains == 0) {
    photons.clear();
    return 0;
  }
  // A task of one thread: about as many states as a chunk of light paths.
  const std::uint64_t each = std::max<std::uint64_t>(1, kLightChunk / (1 + mutations / chains)),
                      tasks = (chains + each - 1) / each;
  photons.resize(tasks);
  std::vector<std::uint64_t> accepted(tasks);
  CANDELA_TRY(for_each_task(
      tasks, film, run,
      [&](std::uint64_t task, film::SampleCounts& sample_counts) {
        PhotonStore& store = photons[task];
        store.keeping = pass.keeping();
        store.clear();
        LightPaths<kEdgeContent> paths(pass.context, pass.options, pass.counts, pass.places, store,
                                       sample_counts);
        mcmc::PrimaryState numbers(steps);
        for (std::uint64_t c = task * each; c < std::min(chains, (task + 1) * each); ++c) {
          if (run.stopped()) return;
          const mcmc::ShortChain chain{pass.path_key(visible[c]), pass.chain_key(c),
                                       mcmc::short_chain_length(mutations, chains, c)};
          accepted[task] += mcmc::run_short_chain(numbers, chain, paths, run.stop);
        }
      },
      span));
  std::uint64_t sum = 0;
  for (const std::uint64_t count : accepted) sum += count;
  return sum;
}

}  // namespace candela::integrators::mcppm
