// The path integrator: settings, plan, and the choice of an estimator (estimators/path.h) by the plan.
#include "worker/integrators/path/path.h"

#include "worker/estimators/path_dispatch.h"
#include "worker/integrators/eye_samples.h"
#include "worker/integrators/path/plan.h"

namespace candela::integrators {
namespace {

class PathIntegrator final : public Integrator {
 public:
  PathIntegrator(const PathSettings& settings, const scene::SceneFeatures& features) {
    if (settings.max_depth >= 0) options_.max_depth = static_cast<std::uint32_t>(settings.max_depth);
    options_.rr_depth = static_cast<std::uint32_t>(settings.rr_depth);
    options_.min_edges = settings.hide_emitters ? 2 : 1;
    options_.heuristic = settings.heuristic.value == "power" ? transport::MisHeuristic::power
                                                             : transport::MisHeuristic::balance;
    planned_ = path::plan(options_, features, settings.plan.value == "full", plan_);
    radiance_ = estimators::path_radiance_for<samplers::Sampler>(planned_.between);
  }

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

  const Plan& plan() const override { return plan_; }

 private:
  estimators::PathOptions options_;
  Plan plan_;
  path::Planned planned_;
  estimators::RadianceFunction<samplers::Sampler> radiance_ = nullptr;
};

}  // namespace

Result<std::unique_ptr<Integrator>> make_path_integrator(const SettingsMap& settings,
                                                         const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const PathSettings parsed, parse_settings<PathSettings>(settings));
  return std::unique_ptr<Integrator>(std::make_unique<PathIntegrator>(parsed, features));
}

}  // namespace candela::integrators
