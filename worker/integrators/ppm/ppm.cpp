#include "worker/integrators/ppm/ppm.h"

#include "worker/integrators/iteration_integrator.h"
#include "worker/integrators/merging/iterations.h"
#include "worker/integrators/plan_between.h"
#include "worker/integrators/plan_walks.h"

namespace candela::integrators {
namespace {

using estimators::PathOptions;
using estimators::Techniques;

class PpmIntegrator final : public IterationIntegrator {
 public:
  PpmIntegrator(const PathOptions& options, Planned planned, const merging::MergeRules& merge,
                bool caustics_only)
      : IterationIntegrator(options, std::move(planned)),
        iterations_{options_, planned_.techniques, merge, caustics_only} {}

  Result<void> run(const UnitContext& context, const Unit& unit, const UnitInput& /*input*/,
                   UnitOutput& output, const RunContext& run_context) const override {
    return with_between(planned_.between, [&](auto between) {
      return merging::run_progressive<estimators::PpmEye<between(), transport::ConstantScale>>(
          context, unit, iterations_, output, run_context);
    });
  }

 private:
  const merging::IterationOptions iterations_;
};

Planned plan_ppm(const PathOptions& options, bool caustics_only, const scene::SceneFeatures& features,
                 bool full) {
  Planned planned;
  Plan& plan = planned.plan;
  Techniques& t = planned.techniques;
  t = Techniques::none();
  if (options.max_depth < 1 || features.emitters == 0) {
    plan.skip("everything",
              features.emitters == 0 ? "the scene has no emitter" : "max_depth 0 is a black image");
    return planned;
  }
  t.eye_paths = true;
  t.hit_light = !caustics_only;
  if (options.max_depth < 2) {
    plan.skip("photons", "max_depth shows emitters only");
    return planned;
  }
  if (caustics_only && !features.any_delta_bsdf) {
    t = Techniques::none();
    plan.skip("everything", "no surface is specular: there are no caustics");
    return planned;
  }
  t.merge_surface = t.merge_medium = t.light_paths = true;
  note_lasting_media(features, options.max_depth, options.rr_depth, plan);
  if (full) {
    plan.use("everything", "plan=full");
    return planned;
  }
  if (caustics_only) {
    plan.skip("photons that no specular vertex sent", "photons=caustics");
    plan.skip("light met by eye paths", "photons=caustics");
  }
  plan.decide(t.hit_light, "light met by eye paths", features.any_area_emitter || features.any_environment,
              "seen directly, or by specular reflection or refraction",
              "no emitter has an area, and there is no environment");
  plan.decide(t.merge_surface, "photons on surfaces", !features.all_bsdfs_delta,
              "some surface is not specular", "every surface scatters specularly");
  plan.decide(t.merge_medium, "photons in media", features.any_scattering_medium,
              "there are media that scatter", "no medium scatters");
  t.light_paths = t.merges();
  planned.between = plan_between(features, plan, "free flights");
  return planned;
}

}  // namespace

Result<std::unique_ptr<Integrator>> make_ppm_integrator(const SettingsMap& settings,
                                                        const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const PpmSettings parsed, parse_settings<PpmSettings>(settings));
  const PathOptions options = parsed.common.path_options();
  const bool caustics_only = parsed.photons.value == "caustics";
  return std::unique_ptr<Integrator>(std::make_unique<PpmIntegrator>(
      options, plan_ppm(options, caustics_only, features, parsed.common.full_plan()), parsed.merge.rules(),
      caustics_only));
}

}  // namespace candela::integrators
