#include "worker/estimators/edited_light_store.h"
#include "worker/estimators/edited_subpaths.h"
#include "worker/integrators/merging/iterations.h"
#include "worker/integrators/merging/one_radius.h"

namespace candela::integrators::merging {

Result<void> run_edited_ppm(const UnitContext& context, const Unit& unit, const UnitInput& input,
                            const IterationOptions& options, UnitOutput& output, const RunContext& run) {
  using Eye = estimators::PpmEye<transport::EdgeContent::media, transport::ConstantScale,
                                 transport::NoStatistics, true>;
  return run_progressive<Eye>(context, unit, input, options, output, run);
}

}  // namespace candela::integrators::merging
