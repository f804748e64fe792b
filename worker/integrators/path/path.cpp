// The path integrator: settings, plan, and the choice of a kernel (kernel.h) by the plan.
#include "worker/integrators/path/path.h"

#include "worker/integrators/eye_samples.h"
#include "worker/integrators/path/kernels.h"
#include "worker/integrators/path/plan.h"

namespace candela::integrators {
namespace {

using path::Limits;

class PathIntegrator final : public Integrator {
 public:
  PathIntegrator(const PathSettings& settings, const scene::SceneFeatures& features) {
    limits_.max_depth = settings.max_depth < 0 ? 0xffffffffu : static_cast<std::uint32_t>(settings.max_depth);
    limits_.rr_depth = static_cast<std::uint32_t>(settings.rr_depth);
    limits_.least_edges = settings.hide_emitters ? 2 : 1;
    limits_.power_heuristic = settings.heuristic.value == "power";
    limits_.choose_emitter = features.emitters > 1 || features.any_mesh_emitter;
    kernel_ = path::kernel_for<samplers::Sampler>(
        path::plan(limits_, features, settings.plan.value == "full", plan_));
  }

  Result<void> run(const UnitContext& context, const Unit& unit, film::UnitFilm& film,
                   const RunContext& run_context) const override {
    return run_eye_samples(context, unit, film, run_context,
                           [&](const Ray& ray, samplers::Sampler& sampler, film::Tallies& tallies) {
                             return kernel_(context.scene, limits_, ray, sampler, tallies);
                           });
  }

  std::vector<float> pilot_luminances(const UnitContext& context, std::uint32_t count) const override {
    return pilot_eye_samples(context, count,
                             [&](const Ray& ray, samplers::Sampler& sampler, film::Tallies& tallies) {
                               return kernel_(context.scene, limits_, ray, sampler, tallies);
                             });
  }

  const Plan& plan() const override { return plan_; }

 private:
  Limits limits_{};
  Plan plan_;
  path::RadianceFunction<samplers::Sampler> kernel_ = nullptr;
};

}  // namespace

Result<std::unique_ptr<Integrator>> make_path_integrator(const SettingsMap& settings,
                                                         const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const PathSettings parsed, parse_settings<PathSettings>(settings));
  return std::unique_ptr<Integrator>(std::make_unique<PathIntegrator>(parsed, features));
}

}  // namespace candela::integrators
