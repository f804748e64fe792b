// Stochastic progressive photon mapping [Hachisuka 2009] in the form of [Knaus 2011]: every iteration has
// light paths of its own and a radius that follows from its number.
#include "common/stats/inner_merges.h"
#include "worker/integrators/iteration_integrator.h"
#include "worker/integrators/makers.h"
#include "worker/integrators/merging/chosen_radius.h"
#include "worker/integrators/merging/one_radius.h"
#include "worker/integrators/ppm/plan.h"
#include "worker/integrators/ppm/settings.h"

namespace candela::integrators {
namespace {

using estimators::PathOptions;

class PpmIntegrator final : public IterationIntegrator {
 public:
  PpmIntegrator(const PathOptions& options, Planned planned, const merging::MergeRules& merge,
                bool caustics_only)
      : IterationIntegrator(options, std::move(planned)),
        iterations_{options_, planned_.techniques, merge, caustics_only} {}

  WorkPlan work(FilmSize size, const NamedState& state) const override {
    if (!planned_.techniques.merges()) return {};
    return {.accumulators = {stats::inner_merges_spec(size.width, size.height, state.film_scale_log2)}};
  }
  Result<Decision> decide(const UnitContext& context, const RunContext& /*run*/) const override {
    return merging::decide_radius(plan(), context, iterations_);
  }
  Result<void> run(const UnitContext& context, const Unit& unit, const UnitInput& input, UnitOutput& output,
                   const RunContext& run_context) const override {
    return merging::run_ppm(planned_.between, context, unit, input, iterations_, output, run_context);
  }

 private:
  const merging::IterationOptions iterations_;
};

}  // namespace

Result<std::unique_ptr<Integrator>> make_ppm_integrator(const SettingsMap& settings,
                                                        const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const PpmSettings parsed, parse_settings<PpmSettings>(settings));
  const PathOptions options = parsed.common.path_options();
  const bool caustics_only = parsed.photons.value == "caustics";
  return std::unique_ptr<Integrator>(std::make_unique<PpmIntegrator>(
      options, ppm::plan(options, caustics_only, features, parsed.common.full_plan()), parsed.merge.rules(),
      caustics_only));
}

}  // namespace candela::integrators
