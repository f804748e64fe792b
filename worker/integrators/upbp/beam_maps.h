// Light side of the iterations of upbp: that of vcm on surfaces; in media photons and beams.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "common/rng/stream.h"
#include "worker/integrators/merging/photon_maps.h"
#include "worker/integrators/upbp/hits.h"
#include "worker/integrators/upbp/memory.h"
#include "worker/integrators/upbp/rules.h"
#include "worker/integrators/upbp/scales.h"
#include "worker/integrators/upbp/stores.h"
#include "worker/integrators/upbp/work_counts.h"

namespace candela::integrators::upbp {

// Sums over all iterations of a unit.
struct Measured {
  WorkCounts work;
  HitCounts hits;
  Memory memory;
};

inline BeamPaths beam_paths_of(const MediumRules& rules, const UnitContext& context, std::uint64_t iteration,
                               std::uint64_t paths) {
  if (rules.beam_paths == 0 || paths <= rules.beam_paths) return {};
  const std::uint64_t stride = (paths + rules.beam_paths - 1) / rules.beam_paths;
  rng::Stream place(rng::key(context.seed, 0x6265616d73ULL, iteration));  // "beams"
  return {stride, place.next_u64() % stride};
}

// As merging::PhotonMaps, for run_iterations().
class BeamMaps {
 public:
  static constexpr transport::EdgeContent kEdgeContent = transport::EdgeContent::media;
  using Mis = transport::BeamBalance;
  using Field = transport::ConstantScale;
  using Eye = estimators::VcmEye<kEdgeContent, Mis, Field, transport::NoStatistics, EyeBeams>;

  // first: merging radius of the first iteration, of surfaces. hits: that weights expect. measured: each
  // iteration is added. Arguments have to outlive the maps.
  BeamMaps(const UnitContext& context, const merging::IterationOptions& options, const MediumRules& rules,
           double first, const ExpectedHits& hits, Measured& measured)
      : context_(context),
        options_(options),
        rules_(rules),
        first_(first),
        hits_(hits),
        measured_(measured),
        chunks_(light_chunk_count(path_count_)),
        beam_chunks_(chunks_.size()) {}

  void start(std::uint64_t iteration) { now_.emplace(*this, iteration); }
  Result<void> trace(std::uint32_t half, std::uint64_t index, film::UnitFilm& film, const RunContext& run,
                     ProgressSpan span) {
    const estimators::Techniques& techniques = options_.techniques;
    const auto store_of = [&](std::uint64_t chunk) {
      chunks_[chunk].keeping = {.vertices = techniques.connect,
                                .surface_photons = techniques.merge_surface,
                                .medium_photons = rules_.points(),
                                .survivals = rules_.long_photon_beams};
      chunks_[chunk].clear();
      beam_chunks_[chunk].clear();
      return BeamStore(chunks_[chunk], beam_chunks_[chunk], context_.scene, now_->scales.eta.data(),
                       rules_.beams(), now_->beam_paths, chunk * kLightChunk, options_.paths.max_depth - 1);
    };
    return merging::trace_light_paths<kEdgeContent, Mis>(
        context_, options_.paths, techniques, now_->counts, transport::EtaOf<Field>{now_->side.field}, half,
        index, store_of, film, run, span, options_.technique_layers ? 1 : 0);
  }
  Result<void> build(unsigned threads) {
    const IterationScales& scales = now_->scales;
    if (options_.techniques.merge_surface) {
      CANDELA_TRY(merging::build_photon_map(chunks_, &Photons::surface, now_->side.field.scale.disc_radius,
                                            threads, surface_));
      now_->side.maps.surface = &surface_;
    }
    if (rules_.points()) {
      std::vector<const transport::PhotonBuffer<transport::MisBlock>*> buffers;
      for (const Photons& chunk : chunks_) buffers.push_back(&chunk.medium);
      // In a grid the weights of merges with photons ask for the hazards of photons, if beams are merged too.
      const bool hazards = rules_.beams() && context_.scene.features().any_heterogeneous_medium;
      const std::span<const float> balls(scales.ball_radii.data(),
                                         rules_.pp3d ? scales.ball_radii.size() : 0);
      CANDELA_TRY(points_.build(buffers, {balls, rules_.pb2d, hazards ? &context_.scene : nullptr}, threads));
      now_->medium.points = &points_;
      if (rules_.pp3d) measured_.work.searched += points_.size();
      if (rules_.pb2d) measured_.work.points += points_.size();
    }
    if (rules_.beams()) {
      std::vector<const transport::BeamBuffer*> buffers;
      for (const transport::BeamBuffer& chunk : beam_chunks_) buffers.push_back(&chunk);
      CANDELA_TRY(beams_.build(buffers, scales.beam_radii, threads));
      now_->medium.beams = &beams_;
      measured_.work.pieces += beams_.pieces();
    }
    measured_.memory.add(
        memory_of(chunks_, beam_chunks_, now_->side.maps.surface, now_->medium.points, now_->medium.beams));
    return {};
  }
  const Eye::Side& side() const { return now_->side; }
  const estimators::PathCounts& counts() const { return now_->counts; }
  void finish() {
    measured_.work.add(now_->work.sum());
    measured_.hits.add(now_->work.sum(), now_->number);
  }

 private:
  // Facts of one iteration. A handle: parts refer to others.
  struct Iteration {
    Iteration(const BeamMaps& maps, std::uint64_t number_)
        : number(number_),
          beam_paths(beam_paths_of(maps.rules_, maps.context_, number, maps.path_count_)),
          scales(iteration_scales(
              maps.rules_, maps.options_.merge, maps.options_.techniques, maps.context_.scene, maps.first_,
              number, static_cast<double>(maps.path_count_),
              static_cast<double>(maps.path_count_) / static_cast<double>(beam_paths.stride), maps.hits_)),
          counts(merging::path_counts(maps.context_, maps.path_count_)),
          side{{{}, maps.chunks_, maps.path_count_, scales.surfaces, maps.context_.letters}, medium, work} {
      counts.medium = scales.eta.data();
      counts.connect_media = maps.rules_.connect_media;
      medium.kernels = scales.kernels;
      medium.factors = estimators::mis_factors<Mis>(maps.options_.techniques, counts);
      medium.per_path = side.maps.per_path = static_cast<float>(1 / counts.light_paths);
      medium.paths_per_beam_path = static_cast<float>(beam_paths.stride);
      medium.max_edges = side.maps.max_edges = maps.options_.paths.max_depth;
    }

    const std::uint64_t number;
    const BeamPaths beam_paths;
    const IterationScales scales;
    estimators::PathCounts counts;
    transport::MediumMaps medium;
    SharedWork work;
    Eye::Side side;
  };

  const UnitContext& context_;
  const merging::IterationOptions& options_;
  const MediumRules& rules_;
  const double first_;
  const ExpectedHits& hits_;
  Measured& measured_;
  const std::uint64_t path_count_ = merging::light_path_count(options_.merge, context_);
  merging::LightChunks<transport::MisBlock> chunks_;
  std::vector<transport::BeamBuffer> beam_chunks_;
  transport::PhotonMap<transport::MisBlock> surface_;
  transport::PhotonPoints points_;
  transport::PhotonBeams beams_;
  std::optional<Iteration> now_;
};

}  // namespace candela::integrators::upbp
