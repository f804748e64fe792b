// Light tracing: paths from the emitters, each vertex connected to the lens [Dutre 1993], and light that
// meets a finite lens by itself. Emitters seen directly are found by eye rays. What the camera sees by
// specular reflection or refraction alone no connection to the lens can find: see docs/integrators/light.md.
#include "worker/estimators/edited_light_store.h"
#include "worker/estimators/eye_radiance.h"
#include "worker/estimators/light_tracing.h"
#include "worker/estimators/path_dispatch.h"
#include "worker/integrators/eye_samples.h"
#include "worker/integrators/iteration_integrator.h"
#include "worker/integrators/light/settings.h"
#include "worker/integrators/light_paths.h"
#include "worker/integrators/makers.h"
#include "worker/integrators/plan_edge_content.h"
#include "worker/integrators/plan_walks.h"
#include "worker/scene/objects.h"

namespace candela::integrators {
namespace {

using estimators::PathOptions;
using estimators::Techniques;
using transport::EdgeContent;

// Emitters seen by the camera, straight through what passes light on.
template <EdgeContent kEdgeContent>
Result<void> run_eye_rays(PathOptions options, const UnitContext& context, const Unit& unit,
                          film::UnitFilm& film, const RunContext& run) {
  options.max_depth = 1;
  return run_eye_samples(context, unit, film, run,
                         estimators::EyeRadianceFunction<kEdgeContent>(context.scene, options));
}

template <EdgeContent kEdgeContent, class Mis>
Result<void> run_light(const PathOptions& options, const Techniques& techniques, const UnitContext& context,
                       const Unit& unit, film::UnitFilm& film, const RunContext& run) {
  const std::uint64_t paths = std::uint64_t{context.width} * context.height;
  const estimators::PathCounts counts{static_cast<double>(paths), static_cast<double>(paths),
                                      static_cast<float>(context.filter.radius())};
  const transport::Splatter splatter(context.filter, film, context.width, context.height);
  const transport::ConstantEta no_merging;
  if constexpr (kEdgeContent == EdgeContent::media) {
    const estimators::EditedNoStore no_store;
    if (context.scene.objects().path_edits != nullptr)
      return run_light_paths(context, unit, paths, film, run, [&](film::SampleCounts& sample_counts) {
        return estimators::LightTracing<kEdgeContent, Mis, const estimators::EditedNoStore,
                                        transport::ConstantEta>(context.scene, options, techniques, counts,
                                                                no_merging, splatter, no_store, sample_counts,
                                                                0, context.letters);
      });
  }
  const estimators::NoStore no_store;
  return run_light_paths(context, unit, paths, film, run, [&](film::SampleCounts& sample_counts) {
    return estimators::LightTracing<kEdgeContent, Mis, const estimators::NoStore, transport::ConstantEta>(
        context.scene, options, techniques, counts, no_merging, splatter, no_store, sample_counts, 0,
        context.letters);
  });
}

class LightIntegrator final : public IterationIntegrator {
 public:
  using IterationIntegrator::IterationIntegrator;

  Result<void> run(const UnitContext& context, const Unit& unit, const UnitInput& /*input*/,
                   UnitOutput& output, const RunContext& run_context) const override {
    const bool edited = context.scene.objects().path_edits != nullptr;
    return with_edge_content(edited ? EdgeContent::media : planned_.between, [&](auto between) {
      return run_kernel<between()>(context, unit, *output.film, run_context);
    });
  }

  std::vector<float> pilot_luminances(const UnitContext& context, std::uint32_t count) const override {
    if (context.scene.objects().path_edits == nullptr) return pilot_by_eye_walk(context, count, options_);
    return pilot_eye_samples(
        context, count, [&](const Ray& ray, samplers::Sampler& sampler, film::SampleCounts& sample_counts) {
          return estimators::path_radiance_with_edits(context.scene, options_, {}, ray, sampler,
                                                      sample_counts, nullptr, nullptr);
        });
  }

 private:
  // Both techniques can find the same light through a finite lens; then they are weighted.
  template <EdgeContent kEdgeContent>
  Result<void> run_kernel(const UnitContext& context, const Unit& unit, film::UnitFilm& film,
                          const RunContext& run) const {
    if (planned_.techniques.eye_paths)
      CANDELA_TRY(run_eye_rays<kEdgeContent>(options_, context, unit, film, run));
    if (planned_.techniques.hit_lens)
      return run_light<kEdgeContent, transport::Balance>(options_, planned_.techniques, context, unit, film,
                                                         run);
    if (planned_.techniques.light_image)
      return run_light<kEdgeContent, transport::Unweighted>(options_, planned_.techniques, context, unit,
                                                            film, run);
    return {};
  }
};

Planned plan_light(const PathOptions& options, const scene::SceneFeatures& features, bool full) {
  Planned planned;
  Plan& plan = planned.plan;
  Techniques& t = planned.techniques;
  t = Techniques::none();
  if (options.max_depth < 1) {
    plan.skip("everything", "max_depth 0 is a black image");
    return planned;
  }
  const bool hide_emitters = options.min_edges > 1;
  t.eye_paths = !hide_emitters;
  t.light_image = t.hit_lens = options.max_depth >= 2 && features.emitters > 0;
  note_lasting_media(features, options.max_depth, options.rr_depth, plan);
  if (full) {
    plan.use("everything", "plan=full");
    return planned;
  }
  if (hide_emitters) plan.skip("eye rays", "hide_emitters");
  plan.decide(t.eye_paths, "eye rays", features.any_area_emitter || features.any_environment,
              "emitters seen directly", "no emitter can be seen directly");
  if (!t.light_image) plan.skip("connections to the lens", "no light paths");
  plan.decide(t.light_image, "connections to the lens",
              !features.all_bsdfs_delta || features.any_scattering_medium,
              "light paths scatter where the camera may see it", "every surface scatters specularly");
  plan.decide(t.hit_lens, "light that meets the lens", features.finite_lens, "the lens has an area",
              "the lens is a point, or infinitely far");
  if (features.any_delta_bsdf)
    plan.skip("what the camera sees by specular reflection or refraction",
              "light tracing cannot find it: bdpt or vcm can");
  planned.between = plan_edge_content(features, plan);
  return planned;
}

}  // namespace

Result<std::unique_ptr<Integrator>> make_light_integrator(const SettingsMap& settings,
                                                          const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const LightSettings parsed, parse_settings<LightSettings>(settings));
  const PathOptions options = parsed.common.path_options();
  return std::unique_ptr<Integrator>(
      std::make_unique<LightIntegrator>(options, plan_light(options, features, parsed.common.full_plan())));
}

}  // namespace candela::integrators
