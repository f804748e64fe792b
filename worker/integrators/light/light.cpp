#include "worker/integrators/light/light.h"

#include "worker/estimators/light_tracing.h"
#include "worker/integrators/bidirectional/pilot.h"
#include "worker/integrators/eye_samples.h"
#include "worker/integrators/light_paths.h"
#include "worker/integrators/plan_between.h"
#include "worker/integrators/plan_walks.h"

namespace candela::integrators {
namespace {

using estimators::PathOptions;
using estimators::Techniques;
using transport::Between;

// Emitters seen by the camera, straight through what passes light on.
template <Between kBetween>
Result<void> run_eye_rays(PathOptions options, const UnitContext& context, const Unit& unit,
                          film::UnitFilm& film, const RunContext& run) {
  options.max_depth = 1;
  return run_eye_samples(context, unit, film, run,
                         estimators::EyeRadianceFunction<kBetween>(context.scene, options));
}

template <Between kBetween, class Mis>
Result<void> run_light(const PathOptions& options, const Techniques& techniques, const UnitContext& context,
                       const Unit& unit, film::UnitFilm& film, const RunContext& run) {
  const std::uint64_t paths = std::uint64_t{context.width} * context.height;
  const estimators::PathCounts counts{static_cast<double>(paths), static_cast<double>(paths),
                                      static_cast<float>(context.filter.radius())};
  const transport::Splatter splatter(context.filter, film, context.width, context.height);
  const transport::ConstantEta no_merging;
  const estimators::NoStore no_store;
  return run_light_paths(context, unit, paths, film, run, [&](film::Tallies& tallies) {
    return estimators::LightTracing<kBetween, Mis, const estimators::NoStore, transport::ConstantEta>(
        context.scene, options, techniques, counts, no_merging, splatter, no_store, tallies);
  });
}

class LightIntegrator final : public Integrator {
 public:
  LightIntegrator(const LightSettings& settings, const scene::SceneFeatures& features) {
    if (settings.max_depth >= 0) options_.max_depth = static_cast<std::uint32_t>(settings.max_depth);
    options_.rr_depth = static_cast<std::uint32_t>(settings.rr_depth);
    options_.min_edges = settings.hide_emitters ? 2 : 1;
    techniques_.eye_paths = techniques_.light_image = techniques_.hit_lens = true;
    make_plan(settings, features);
  }

  Result<void> run(const UnitContext& context, const Unit& unit, const UnitInput& /*input*/,
                   UnitOutput& output, const RunContext& run_context) const override {
    return with_between(between_, [&](auto between) {
      return run_kernel<between()>(context, unit, *output.film, run_context);
    });
  }

  std::vector<float> pilot_luminances(const UnitContext& context, std::uint32_t count) const override {
    return bidirectional::pilot(context, count, options_);
  }

  const Plan& plan() const override { return plan_; }

 private:
  void make_plan(const LightSettings& settings, const scene::SceneFeatures& features);

  // Both techniques can find the same light through a finite lens; then they are weighted.
  template <Between kBetween>
  Result<void> run_kernel(const UnitContext& context, const Unit& unit, film::UnitFilm& film,
                          const RunContext& run) const {
    if (techniques_.eye_paths) CANDELA_TRY(run_eye_rays<kBetween>(options_, context, unit, film, run));
    if (techniques_.hit_lens)
      return run_light<kBetween, transport::Balance>(options_, techniques_, context, unit, film, run);
    if (techniques_.light_image)
      return run_light<kBetween, transport::Unweighted>(options_, techniques_, context, unit, film, run);
    return {};
  }

  PathOptions options_;
  Techniques techniques_ = Techniques::none();
  Between between_ = Between::media;
  Plan plan_;
};

void LightIntegrator::make_plan(const LightSettings& settings, const scene::SceneFeatures& features) {
  if (options_.max_depth < 1) {
    techniques_.eye_paths = techniques_.light_image = techniques_.hit_lens = false;
    plan_.skip("everything", "max_depth 0 is a black image");
    return;
  }
  if (options_.max_depth < 2) techniques_.light_image = techniques_.hit_lens = false;
  if (options_.min_edges > 1) techniques_.eye_paths = false;
  if (features.emitters == 0) techniques_.light_image = techniques_.hit_lens = false;
  note_lasting_media(features, options_.max_depth, options_.rr_depth, plan_);
  if (settings.plan.value == "full") {
    plan_.use("everything", "plan=full");
    return;
  }
  if (!features.any_area_emitter && !features.any_environment && techniques_.eye_paths) {
    techniques_.eye_paths = false;
    plan_.skip("eye rays", "no emitter can be seen directly");
  } else if (techniques_.eye_paths) {
    plan_.use("eye rays", "emitters seen directly");
  } else {
    plan_.skip("eye rays", "hide_emitters");
  }
  if (techniques_.light_image && features.all_bsdfs_delta && !features.any_scattering_medium) {
    techniques_.light_image = false;
    plan_.skip("connections to the lens", "every surface scatters specularly");
  } else if (techniques_.light_image) {
    plan_.use("connections to the lens", "light paths scatter where the camera may see it");
  } else {
    plan_.skip("connections to the lens", "no light paths");
  }
  if (!features.finite_lens && techniques_.hit_lens) {
    techniques_.hit_lens = false;
    plan_.skip("light that meets the lens", "the lens is a point, or infinitely far");
  } else if (techniques_.hit_lens) {
    plan_.use("light that meets the lens", "the lens has an area");
  }
  if (features.any_delta_bsdf)
    plan_.skip("what the camera sees by specular reflection or refraction",
               "light tracing cannot find it: bdpt or vcm can");
  between_ = plan_between(features, plan_);
}

}  // namespace

Result<std::unique_ptr<Integrator>> make_light_integrator(const SettingsMap& settings,
                                                          const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const LightSettings parsed, parse_settings<LightSettings>(settings));
  return std::unique_ptr<Integrator>(std::make_unique<LightIntegrator>(parsed, features));
}

}  // namespace candela::integrators
