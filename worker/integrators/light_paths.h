// The loops over light paths: fixed chunks of them over threads, each path named by (seed, half, index, path
// number). What a path adds to the film it splats (UnitFilm::splat: integer adds, the same in any order), so
// nothing depends on the threads.
//
// Other results of the paths (a photon map) must not depend on them either: a chunk has a number,
// begin / kLightChunk, so that each can write to a place of its own that is joined in the order of numbers.
#pragma once

#include <algorithm>
#include <cstdint>

#include "worker/estimators/light_store.h"
#include "worker/integrators/integrator.h"
#include "worker/integrators/parallel_tasks.h"

namespace candela::integrators {

using estimators::kLightChunk;

constexpr std::uint64_t light_chunk_count(std::uint64_t path_count) {
  return (path_count + kLightChunk - 1) / kLightChunk;
}

// Runs body(begin, end, sample_counts) for the chunks [begin, end) of the paths [0, path_count), as
// for_each_task. The body counts sample_counts.light_paths. A body that takes long looks at run.stop itself
// and may return early.
template <class Body>
Result<void> for_each_light_chunk(std::uint64_t path_count, film::UnitFilm& film, const RunContext& run,
                                  const Body& body, ProgressSpan span = {}) {
  return for_each_task(
      light_chunk_count(path_count), film, run,
      [&](std::uint64_t chunk, film::SampleCounts& sample_counts) {
        const std::uint64_t begin = chunk * kLightChunk;
        body(begin, std::min(begin + kLightChunk, path_count), sample_counts);
      },
      span);
}

// Traces `paths_per_iteration` light paths for each iteration of the unit: make_tracer(sample_counts)
// returns, for each chunk, what traces one: tracer(path, sampler) with the sampler at the path's start.
// Counts light_paths. For integrators whose light paths know nothing of each other: iterations run without a
// barrier between them.
template <class MakeTracer>
Result<void> run_light_paths(const UnitContext& context, const Unit& unit, std::uint64_t paths_per_iteration,
                             film::UnitFilm& film, const RunContext& run, const MakeTracer& make_tracer,
                             ProgressSpan span = {}) {
  return for_each_light_chunk(
      paths_per_iteration, film, run,
      [&](std::uint64_t begin, std::uint64_t end, film::SampleCounts& sample_counts) {
        samplers::Sampler sampler(context.sampler, context.seed);
        auto&& tracer = make_tracer(sample_counts);
        for (std::uint64_t index = unit.begin; index < unit.end; ++index) {
          for (std::uint64_t path = begin; path < end; ++path) {
            if (path % 64 == 0 && run.stopped()) return;
            sampler.start_light(unit.half, index, path);
            tracer(path, sampler);
          }
          sample_counts.light_paths += end - begin;
        }
      },
      span);
}

}  // namespace candela::integrators
