// Light side of the iterations of vcm, ppm and their kin: photon maps of surfaces and of media, and vertices
// to connect to.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>

#include "worker/estimators/merging_eye.h"
#include "worker/integrators/merging/chosen_radius.h"
#include "worker/integrators/merging/iteration_options.h"
#include "worker/integrators/merging/light_pass.h"
#include "worker/integrators/merging/scales.h"

namespace candela::integrators::merging {

inline estimators::PathCounts path_counts(const UnitContext& context, std::uint64_t light_paths) {
  return {
      static_cast<double>(context.width) * context.height, static_cast<double>(light_paths),
      static_cast<float>(context.filter.radius()) * std::max(context.camera_units.x, context.camera_units.y)};
}

// For each iteration: start(), trace() if light paths run, build(), then side() and counts() for the eye
// paths, finish(). Each light side of run_iterations() has these functions.
// Scales: see scales.h. Arguments of the constructor have to outlive the maps.
template <class EyeEstimator, class Scales>
class PhotonMaps {
 public:
  using Mis = typename EyeEstimator::Mis;
  using Block = typename Mis::Block;
  using Field = typename Scales::Field;
  using Side = estimators::LightSide<Block, Field>;

  PhotonMaps(const UnitContext& context, const IterationOptions& options, Scales& scales)
      : context_(context),
        options_(options),
        scales_(scales),
        counts_(path_counts(context, light_path_count(options.merge, context))) {}

  // iteration: of the job.
  void start(std::uint64_t iteration) {
    side_.emplace(Side{{},
                       chunks_,
                       static_cast<std::uint64_t>(counts_.light_paths),
                       scales_.field(iteration),
                       context_.letters,
                       &edits_});
    side_->maps.max_edges = options_.paths.max_depth;
    side_->maps.per_path = static_cast<float>(1 / counts_.light_paths);
    if constexpr (requires { EyeEstimator::max_density(context_.scene); })
      side_->maps.max_density = EyeEstimator::max_density(context_.scene);
  }
  // index: of the iteration in the half.
  Result<void> trace(std::uint32_t half, std::uint64_t index, film::UnitFilm& film, const RunContext& run,
                     ProgressSpan span) {
    const estimators::Techniques& techniques = options_.techniques;
    const estimators::LightKeeping keeping{techniques.connect, techniques.merge_surface,
                                           techniques.merge_medium, options_.caustics_only,
                                           EyeEstimator::Statistics::kCollects};
    const transport::EtaOf<Field> eta{side_->field};
    if constexpr (EyeEstimator::kEdits)
      return run_edited_light_pass<kEdgeContent, Mis>(context_, options_.paths, techniques, counts_, keeping,
                                                      eta, half, index, chunks_, edits_, film, run, span);
    else
      return run_light_pass<kEdgeContent, Mis>(context_, options_.paths, techniques, counts_, keeping, eta,
                                               half, index, chunks_, film, run, span);
  }
  Result<void> build(unsigned threads) {
    const SearchRadii radii = scales_.search_radii(side_->field);
    if (options_.techniques.merge_surface) {
      CANDELA_TRY(
          build_photon_map(chunks_, &estimators::LightStore<Block>::surface, radii.disc, threads, surface_));
      side_->maps.surface = &surface_;
    }
    if (options_.techniques.merge_medium) {
      CANDELA_TRY(
          build_photon_map(chunks_, &estimators::LightStore<Block>::medium, radii.ball, threads, medium_));
      side_->maps.medium = &medium_;
    }
    return {};
  }
  const Side& side() const { return *side_; }
  const estimators::PathCounts& counts() const { return counts_; }
  static void finish() {}

 private:
  static constexpr transport::EdgeContent kEdgeContent = EyeEstimator::EyeWalk::kContent;

  const UnitContext& context_;
  const IterationOptions& options_;
  Scales& scales_;
  const estimators::PathCounts counts_;
  LightChunks<Block> chunks_;
  transport::PhotonMap<Block> surface_, medium_;
  estimators::EditedLight edits_;
  std::optional<Side> side_;  // of the iteration
};

}  // namespace candela::integrators::merging
