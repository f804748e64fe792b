#include "worker/integrators/merging/iterations.h"
#include "worker/integrators/merging/one_radius.h"
#include "worker/integrators/plan_edge_content.h"
#include "worker/scene/objects.h"

namespace candela::integrators::merging {

Result<void> run_ppm(transport::EdgeContent chosen, const UnitContext& context, const Unit& unit,
                     const UnitInput& input, const IterationOptions& options, UnitOutput& output,
                     const RunContext& run) {
  if (context.scene.objects().path_edits != nullptr)
    return run_edited_ppm(context, unit, input, options, output, run);
  return with_edge_content(chosen, [&](auto between) {
    using Eye = estimators::PpmEye<between(), transport::ConstantScale>;
    return run_progressive<Eye>(context, unit, input, options, output, run);
  });
}

}  // namespace candela::integrators::merging
