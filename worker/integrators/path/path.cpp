// The path integrator: settings, plan, and the choice of a kernel (kernel.h) by the plan.
#include "worker/integrators/path/path.h"

#include <array>
#include <utility>

#include "worker/integrators/eye_samples.h"
#include "worker/integrators/path/kernel.h"

namespace candela::integrators {
namespace {

using path::Between;
using path::Limits;
using path::Techniques;

using RadianceFunction = Spectrum (*)(const scene::Scene&, const Limits&, Ray, samplers::Sampler&,
                                      film::Tallies&);

template <std::size_t... I>
constexpr auto make_kernels(std::index_sequence<I...>) {
  return std::array<RadianceFunction, sizeof...(I)>{
      &path::radiance<(I & 1) != 0, (I & 2) != 0, (I & 4) != 0, (I & 8) != 0, static_cast<Between>(I >> 4),
                      scene::Scene>...};
}

RadianceFunction kernel_for(const Techniques& t) {
  static constexpr auto kKernels = make_kernels(std::make_index_sequence<48>{});
  return kKernels[std::size_t{t.next_event} | std::size_t{t.hit_emitters} << 1 |
                  std::size_t{t.environment} << 2 | std::size_t{t.weigh} << 3 |
                  static_cast<std::size_t>(t.between) << 4];
}

class PathIntegrator final : public Integrator {
 public:
  PathIntegrator(const PathSettings& settings, const scene::SceneFeatures& features) {
    limits_.max_depth = settings.max_depth < 0 ? 0xffffffffu : static_cast<std::uint32_t>(settings.max_depth);
    limits_.rr_depth = static_cast<std::uint32_t>(settings.rr_depth);
    limits_.hide_emitters = settings.hide_emitters;
    limits_.power_heuristic = settings.heuristic.value == "power";
    limits_.choose_emitter = features.emitters > 1 || features.any_mesh_emitter;
    make_plan(settings, features);
    kernel_ = kernel_for(techniques_);
  }

  Result<void> run(const UnitContext& context, const Unit& unit, film::UnitFilm& film,
                   const render::RunContext& run_context) const override {
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
  void make_plan(const PathSettings& settings, const scene::SceneFeatures& features);

  Limits limits_{};
  Techniques techniques_;
  Plan plan_;
  RadianceFunction kernel_ = nullptr;
};

void PathIntegrator::make_plan(const PathSettings& settings, const scene::SceneFeatures& features) {
  if (settings.plan.value == "full") {
    plan_.use("everything", "plan=full");
    return;
  }
  const bool bounces = limits_.max_depth >= 2;
  const bool area_or_environment = features.any_area_emitter || features.any_environment;

  if (!bounces) {
    techniques_.next_event = false;
    plan_.skip("next event estimation", "max_depth shows emitters only");
  } else if (features.emitters == 0) {
    techniques_.next_event = false;
    plan_.skip("next event estimation", "the scene has no emitter");
  } else if (features.all_bsdfs_delta && !features.any_scattering_medium) {
    techniques_.next_event = false;
    plan_.skip("next event estimation",
               "every surface scatters specularly: no sampled light direction can matter");
  } else if (features.any_scattering_medium) {
    plan_.use("next event estimation", "emitters can be sampled from points in media and from surfaces");
  } else {
    plan_.use("next event estimation", "emitters can be sampled from surfaces that are not specular");
  }

  techniques_.hit_emitters = features.any_area_emitter;
  if (features.any_area_emitter)
    plan_.use("light found by bsdf sampling", "area emitters can be hit");
  else
    plan_.skip("light found by bsdf sampling on surfaces", "no surface emits");

  techniques_.environment = features.any_environment;
  if (features.any_environment)
    plan_.use("light from outside the scene", "there is an environment");
  else
    plan_.skip("light from outside the scene", "no environment");

  techniques_.weigh = techniques_.next_event && area_or_environment;
  if (techniques_.weigh)
    plan_.use("multiple importance sampling", "both techniques can find the same light");
  else
    plan_.skip("multiple importance sampling",
               techniques_.next_event ? "only point-like emitters: bsdf sampling cannot find them"
                                      : "one technique finds all the light there is");

  if (features.any_straight)
    plan_.use("light through surfaces straight on", "some surface is null, a mask or thin glass");
  else
    plan_.skip("light through surfaces straight on", "no surface lets light pass straight");
  if (features.media == 0)
    plan_.skip("media", "there is none");
  else if (!features.any_heterogeneous_medium)
    plan_.use("media", "homogeneous: free flights and transmittance in closed form");
  else
    plan_.use("media", "free flights by delta tracking, transmittance by residual ratio tracking");
  techniques_.between = features.media > 0      ? Between::media
                        : features.any_straight ? Between::surfaces
                                                : Between::nothing;
}

}  // namespace

Result<std::unique_ptr<Integrator>> make_path_integrator(const SettingsMap& settings,
                                                         const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const PathSettings parsed, parse_settings<PathSettings>(settings));
  return std::unique_ptr<Integrator>(std::make_unique<PathIntegrator>(parsed, features));
}

}  // namespace candela::integrators
