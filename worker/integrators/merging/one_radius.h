// The iterations of ppm and of vcm with one radius for the whole film. They are compiled once: integrators
// that decide radii run them where a plan merges nothing.
#pragma once

#include "worker/integrators/integrator.h"
#include "worker/integrators/merging/iteration_options.h"
#include "worker/transport/between.h"

namespace candela::integrators::merging {

// Adds to `output` what the unit brings, as Integrator::run does. between: of the scene's plan.
Result<void> run_ppm(transport::EdgeContent between, const UnitContext& context, const Unit& unit,
                     const UnitInput& input, const IterationOptions& options, UnitOutput& output,
                     const RunContext& run);
Result<void> run_vcm(transport::EdgeContent between, const UnitContext& context, const Unit& unit,
                     const UnitInput& input, const IterationOptions& options, UnitOutput& output,
                     const RunContext& run);

// The same with edits that select by more of the path than the vertex. They have files of their own: here
// they would change what the compiler inlines in the other forms.
Result<void> run_edited_ppm(const UnitContext& context, const Unit& unit, const UnitInput& input,
                            const IterationOptions& options, UnitOutput& output, const RunContext& run);
Result<void> run_edited_vcm(const UnitContext& context, const Unit& unit, const UnitInput& input,
                            const IterationOptions& options, UnitOutput& output, const RunContext& run);

}  // namespace candela::integrators::merging
