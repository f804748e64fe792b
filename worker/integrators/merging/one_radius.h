// The iterations of ppm and of vcm with one radius for the whole film. They are compiled once: integrators
// that decide radii run them where a plan merges nothing.
#pragma once

#include "worker/integrators/integrator.h"
#include "worker/integrators/merging/iteration_options.h"
#include "worker/transport/between.h"

namespace candela::integrators::merging {

// Adds to `output` what the unit brings, as Integrator::run does. between: of the scene's plan.
Result<void> run_ppm(transport::Between between, const UnitContext& context, const Unit& unit,
                     const UnitInput& input, const IterationOptions& options, UnitOutput& output,
                     const RunContext& run);
Result<void> run_vcm(transport::Between between, const UnitContext& context, const Unit& unit,
                     const UnitInput& input, const IterationOptions& options, UnitOutput& output,
                     const RunContext& run);

}  // namespace candela::integrators::merging
