// The path integrator: settings, plan, and the choice of an estimator (estimators/path.h) by the plan.
#include "worker/integrators/path/path.h"

#include "worker/estimators/path_dispatch.h"
#include "worker/integrators/eye_samples.h"
#include "worker/integrators/iteration_integrator.h"
#include "worker/integrators/path/plan.h"

namespace candela::integrators {
namespace {

class PathIntegrator final : public IterationIntegrator {
 public:
  PathIntegrator(const estimators::PathOptions& options, Planned planned)
      : IterationIntegrator(options, std::move(planned)),
        radiance_(estimators::path_radiance_for<samplers::Sampler>(planned_.between)) {}

  Result<void> run(const UnitContext& context, const Unit& unit, const UnitInput& /*input*/,
                   UnitOutput& output, const RunContext& run_context) const override {
    return run_eye_samples(context, unit, *output.film, run_context,
                           [&](const Ray& ray, samplers::Sampler& sampler, film::Tallies& tallies) {
                             return radiance_(context.scene, options_, planned_.techniques, ray, sampler,
                                              tallies);
                           });
  }

  std::vector<float> pilot_luminances(const UnitContext& context, std::uint32_t count) const override {
    return pilot_eye_samples(
        context, count, [&](const Ray& ray, samplers::Sampler& sampler, film::Tallies& tallies) {
          return radiance_(context.scene, options_, planned_.techniques, ray, sampler, tallies);
        });
  }

 private:
  const estimators::RadianceFunction<samplers::Sampler> radiance_;
};

}  // namespace

Result<std::unique_ptr<Integrator>> make_path_integrator(const SettingsMap& settings,
                                                         const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const PathSettings parsed, parse_settings<PathSettings>(settings));
  estimators::PathOptions options = parsed.common.path_options();
  options.heuristic = heuristic_named(parsed.heuristic.value);
  return std::unique_ptr<Integrator>(
      std::make_unique<PathIntegrator>(options, path::plan(options, features, parsed.common.full_plan())));
}

}  // namespace candela::integrators
