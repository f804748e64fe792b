#include "worker/integrators/ppm/ppm.h"

#include "worker/integrators/bidirectional/pilot.h"
#include "worker/integrators/merging/iterations.h"
#include "worker/integrators/plan_between.h"
#include "worker/integrators/plan_walks.h"

namespace candela::integrators {
namespace {

using transport::Between;

class PpmIntegrator final : public Integrator {
 public:
  PpmIntegrator(const PpmSettings& settings, const scene::SceneFeatures& features) {
    options_.paths.max_depth = settings.common.depth();
    options_.paths.rr_depth = static_cast<std::uint32_t>(settings.common.rr_depth);
    options_.paths.min_edges = settings.common.hide_emitters ? 2 : 1;
    options_.merge = settings.merge.rules();
    options_.caustics_only = settings.photons.value == "caustics";
    estimators::Techniques& t = options_.techniques;
    t = estimators::Techniques::none();
    t.eye_paths = t.merge_surface = t.merge_medium = true;
    t.hit_light = !options_.caustics_only;
    make_plan(settings, features);
    t.light_paths = t.merges();
  }

  Result<void> run(const UnitContext& context, const Unit& unit, const UnitInput& /*input*/,
                   UnitOutput& output, const RunContext& run_context) const override {
    return with_between(between_, [&](auto between) {
      return merging::run_iterations<estimators::PpmEye<between(), transport::ConstantEta>>(
          context, unit, options_, *output.film, run_context);
    });
  }

  std::vector<float> pilot_luminances(const UnitContext& context, std::uint32_t count) const override {
    return bidirectional::pilot(context, count, options_.paths);
  }

  const Plan& plan() const override { return plan_; }

 private:
  void make_plan(const PpmSettings& settings, const scene::SceneFeatures& features);

  merging::IterationOptions options_;
  Between between_ = Between::media;
  Plan plan_;
};

void PpmIntegrator::make_plan(const PpmSettings& settings, const scene::SceneFeatures& features) {
  estimators::Techniques& t = options_.techniques;
  if (options_.paths.max_depth < 1 || features.emitters == 0) {
    t.eye_paths = t.hit_light = t.merge_surface = t.merge_medium = false;
    plan_.skip("everything",
               features.emitters == 0 ? "the scene has no emitter" : "max_depth 0 is a black image");
    return;
  }
  if (options_.paths.max_depth < 2) {
    t.merge_surface = t.merge_medium = false;
    plan_.skip("photons", "max_depth shows emitters only");
    return;
  }
  if (options_.caustics_only && !features.any_delta_bsdf) {
    t.eye_paths = t.merge_surface = t.merge_medium = false;
    plan_.skip("everything", "no surface is specular: there are no caustics");
    return;
  }
  note_lasting_media(features, options_.paths.max_depth, options_.paths.rr_depth, plan_);
  if (settings.common.plan.value == "full") {
    plan_.use("everything", "plan=full");
    return;
  }
  if (options_.caustics_only) plan_.skip("photons that no specular vertex sent", "photons=caustics");
  t.hit_light = t.hit_light && (features.any_area_emitter || features.any_environment);
  if (t.hit_light)
    plan_.use("light met by eye paths", "seen directly, or by specular reflection or refraction");
  else if (options_.caustics_only)
    plan_.skip("light met by eye paths", "photons=caustics");
  else
    plan_.skip("light met by eye paths", "no emitter has an area, and there is no environment");
  t.merge_surface = !features.all_bsdfs_delta;
  if (t.merge_surface)
    plan_.use("photons on surfaces", "some surface is not specular");
  else
    plan_.skip("photons on surfaces", "every surface scatters specularly");
  t.merge_medium = features.any_scattering_medium;
  if (t.merge_medium)
    plan_.use("photons in media", "there are media that scatter");
  else
    plan_.skip("photons in media", "no medium scatters");
  between_ = plan_between(features, plan_, "free flights");
}

}  // namespace

Result<std::unique_ptr<Integrator>> make_ppm_integrator(const SettingsMap& settings,
                                                        const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const PpmSettings parsed, parse_settings<PpmSettings>(settings));
  return std::unique_ptr<Integrator>(std::make_unique<PpmIntegrator>(parsed, features));
}

}  // namespace candela::integrators
