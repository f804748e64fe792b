// Unidirectional path tracing from the eye: next event estimation and bsdf sampling combined by multiple
// importance sampling (Veach 1997, ch. 9), Russian roulette on the throughput.
// The path integrator: settings, plan, and the choice of an estimator (estimators/path.h) by the plan.
#include "worker/estimators/path_dispatch.h"
#include "worker/integrators/eye_samples.h"
#include "worker/integrators/iteration_integrator.h"
#include "worker/integrators/makers.h"
#include "worker/integrators/path/plan.h"
#include "worker/integrators/path/settings.h"
#include "worker/scene/emitters/light_groups.h"

namespace candela::integrators {
namespace {

class PathIntegrator final : public IterationIntegrator {
 public:
  PathIntegrator(const estimators::PathOptions& options, Planned planned, bool ray_a_group, bool letters,
                 const Regularization& regularization)
      : IterationIntegrator(options, std::move(planned)),
        ray_a_group_(ray_a_group),
        regularization_(regularization),
        radiance_(estimators::path_radiance_for<samplers::Sampler>(planned_.between, letters)),
        pilot_radiance_(estimators::path_radiance_for<samplers::Sampler>(planned_.between, false)) {}

  Result<void> run(const UnitContext& context, const Unit& unit, const UnitInput& /*input*/,
                   UnitOutput& output, const RunContext& run_context) const override {
    const auto groups = groups_of(context.scene);
    const auto radiance =
        edited(context) ? &estimators::path_radiance_with_edits<samplers::Sampler> : radiance_;
    if (regularization_.runs() && !edited(context))
      return run_mollified(context, unit, groups.get(), *output.film, run_context);
    return run_eye_samples(context, unit, *output.film, run_context,
                           [&](const Ray& ray, samplers::Sampler& sampler, film::SampleCounts& sample_counts,
                               transport::EyeLetters* letters) {
                             return radiance(context.scene, options_, planned_.techniques, ray, sampler,
                                             sample_counts, groups.get(), letters);
                           });
  }

  WorkPlan work(FilmSize /*size*/, const NamedState& /*state*/) const override {
    if (!regularization_.layer()) return {};
    return {.layers = {kMollifiedLayer}};
  }

  std::vector<float> pilot_luminances(const UnitContext& context, std::uint32_t count) const override {
    const auto groups = groups_of(context.scene);
    const auto radiance =
        edited(context) ? &estimators::path_radiance_with_edits<samplers::Sampler> : pilot_radiance_;
    return pilot_eye_samples(
        context, count, [&](const Ray& ray, samplers::Sampler& sampler, film::SampleCounts& sample_counts) {
          return radiance(context.scene, options_, planned_.techniques, ray, sampler, sample_counts,
                          groups.get(), nullptr);
        });
  }

 private:
  Result<void> run_mollified(const UnitContext& context, const Unit& unit, const scene::LightGroups* groups,
                             film::UnitFilm& film, const RunContext& run_context) const {
    return run_eye_samples(context, unit, film, run_context,
                           [&](const Ray& ray, samplers::Sampler& sampler, film::SampleCounts& sample_counts,
                               transport::EyeLetters* /*letters*/, std::uint64_t iteration) {
                             const transport::Mollifier mollifier(regularization_.bandwidth(iteration));
                             ValueWithPart found;
                             found.value = estimators::mollified_path_radiance(
                                 context.scene, options_, planned_.techniques, ray, sampler, sample_counts,
                                 groups, mollifier, regularization_.layer() ? &found.part : nullptr);
                             return found;
                           });
  }

  static bool edited(const UnitContext& context) { return context.scene.objects().path_edits != nullptr; }
  // Null: one shadow ray a vertex.
  std::unique_ptr<scene::LightGroups> groups_of(const scene::Scene& scene) const {
    if (!ray_a_group_) return nullptr;
    return std::make_unique<scene::LightGroups>(scene.lights(), scene::LightPartition::infinite);
  }

  const bool ray_a_group_;
  const Regularization regularization_;
  const estimators::RadianceFunction<samplers::Sampler> radiance_, pilot_radiance_;
};

}  // namespace

Result<std::unique_ptr<Integrator>> make_path_integrator(const SettingsMap& settings,
                                                         const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const PathSettings parsed, parse_settings<PathSettings>(settings));
  estimators::PathOptions options = parsed.common.path_options();
  options.heuristic = heuristic_named(parsed.heuristic.value);
  const bool full = parsed.common.full_plan();
  const bool ray_a_group = !full && path::ray_a_group(features);
  Planned planned = path::plan(options, features, full, ray_a_group, parsed.regularise.mollifies());
  const Regularization regularization = plan_regularization(parsed.regularise, features, options.max_depth,
                                                            transport::Connecting::next_event, planned.plan);
  CANDELA_TRY(check(regularization, features));
  return std::unique_ptr<Integrator>(std::make_unique<PathIntegrator>(
      options, std::move(planned), ray_a_group, features.reads_letters, regularization));
}

}  // namespace candela::integrators
