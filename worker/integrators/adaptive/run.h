// The iterations of a unit with a radius for each pixel.
#pragma once

#include "worker/integrators/adaptive/adaptation.h"
#include "worker/integrators/adaptive/scales.h"
#include "worker/integrators/merging/iterations.h"

namespace candela::integrators::adaptive {

// EyeEstimator: VcmEye or PpmEye with a ScaleMap. statistics(first_radius): what each eye path's statistics
// start as, or what converts to it and lives as long as the iterations.
template <class EyeEstimator, class MakeStatistics>
Result<void> run_adaptive(const UnitContext& context, const Unit& unit, const UnitInput& input,
                          const merging::IterationOptions& options, const Adaptation& adaptation,
                          const MakeStatistics& statistics, UnitOutput& output, const RunContext& run) {
  CANDELA_ASSIGN(const std::string_view map, level_map(input, adaptation, context));
  CANDELA_ASSIGN(const double first, merging::decided_radius(input, options));
  using Scales = MappedScales<typename EyeEstimator::Mis>;
  Scales scales(options.merge, adaptation.levels.radii(first), map, context,
                static_cast<double>(merging::light_path_count(options.merge, context)), options.techniques);
  merging::PhotonMaps<EyeEstimator, Scales> light(context, options, scales);
  return merging::run_iterations<EyeEstimator>(context, unit, options, light, statistics(first), output, run);
}

}  // namespace candela::integrators::adaptive
