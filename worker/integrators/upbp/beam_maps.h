// Light side of the iterations of upbp: that of vcm on surfaces; in media photons and beams.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "worker/integrators/merging/iteration_options.h"
#include "worker/integrators/merging/light_pass.h"
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

// The expected number of light paths of an iteration that leave beams.
double beam_path_count(const MediumRules& rules, const UnitContext& context, std::uint64_t paths);

// As merging::PhotonMaps, for run_iterations().
class BeamMaps {
 public:
  static constexpr transport::EdgeContent kEdgeContent = transport::EdgeContent::media;
  using Mis = transport::BeamBalance;
  using Field = transport::ConstantScale;
  using Eye = estimators::VcmEye<kEdgeContent, Mis, Field, transport::NoStatistics, EyeBeams>;

  // first: merging radius of the first iteration, of surfaces. hits: that weights expect. measured: finish()
  // adds each iteration. All have to outlive the maps.
  BeamMaps(const UnitContext& context, const merging::IterationOptions& options, const MediumRules& rules,
           double first, const ExpectedHits& hits, Measured& measured);

  void start(std::uint64_t iteration);
  Result<void> trace(std::uint32_t half, std::uint64_t index, film::UnitFilm& film, const RunContext& run,
                     ProgressSpan span);
  Result<void> build(unsigned threads);
  const Eye::Side& side() const { return now_->side; }
  const estimators::PathCounts& counts() const { return now_->counts; }
  void finish();

 private:
  // Facts of one iteration. A handle: parts refer to others.
  struct Iteration {
    Iteration(const BeamMaps& maps, std::uint64_t number_);

    const std::uint64_t number;
    const BeamPaths beam_paths;
    const IterationScales scales;
    const estimators::PathCounts counts;
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
  const std::uint64_t path_count_;
  merging::LightChunks<transport::MisBlock> chunks_;
  std::vector<transport::BeamBuffer> beam_chunks_;
  transport::PhotonMap<transport::MisBlock> surface_;
  transport::PhotonPoints points_;
  transport::PhotonBeams beams_;
  std::optional<Iteration> now_;
};

}  // namespace candela::integrators::upbp
