#include "worker/estimators/edited_light_store.h"
#include "worker/estimators/edited_subpaths.h"
#include "worker/integrators/merging/iterations.h"
#include "worker/integrators/merging/one_radius.h"

namespace candela::integrators::merging {

Result<void> run_edited_vcm(const UnitContext& context, const Unit& unit, const UnitInput& input,
                            const IterationOptions& options, UnitOutput& output, const RunContext& run) {
  using Eye = estimators::VcmEye<transport::EdgeContent::media, transport::Balance, transport::ConstantScale,
                                 transport::NoStatistics, estimators::NoBeams, true>;
  return run_progressive<Eye>(context, unit, input, options, output, run);
}

}  // namespace candela::integrators::merging
