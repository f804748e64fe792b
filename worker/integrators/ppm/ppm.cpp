#include "worker/integrators/ppm/ppm.h"

#include "worker/integrators/bidirectional/pilot.h"
#include "worker/integrators/merging/iterations.h"
#include "worker/integrators/plan_between.h"
#include "worker/integrators/plan_walks.h"
#include "worker/transport/emission.h"

namespace candela::integrators {
namespace {

using transport::Between;
using transport::TransportMode;
using transport::Unweighted;

// Kinds of bsdfs with delta lobes, perhaps beside others.
constexpr std::uint32_t kMaySpecular =
    scene::kDeltaKinds | scene::kCompositeKinds | scene::bit(scene::BsdfKind::plastic);

struct PpmKernel {
  std::uint32_t max_depth = 0, rr_depth = 2;
  bool hide_emitters = false;
  bool choose_emitter = true;  // of the pilot
  merging::MergeRules merge;
  bool eye_paths = true, hit_light = true;
  bool merge_surface = true, merge_medium = true;
  bool caustics_only = false;
};

struct Scratch {
  transport::Vertex vertex;
  scene::ClosureArena arena;
};

// The eye's walk goes on where it is reflected or refracted specularly. What its other lobes scatter is
// estimated by merging, all of it, where they are met: so it ends there. Each path is found in one way.
template <Between kBetween>
Spectrum trace_eye(const PpmKernel& kernel, const transport::WalkRules& rules, const scene::Scene& scene,
                   const transport::MergeMaps& maps, const Ray& ray, samplers::Sampler& sampler,
                   Scratch& scratch, film::Tallies& tallies) {
  using EyeWalk = transport::Walk<TransportMode::radiance, kBetween, Unweighted>;
  const transport::MisFactors factors;
  const transport::ConnectContext connect{scene, factors, rules, tallies};
  transport::Contribution light;
  Spectrum sum;
  transport::Vertex& v = scratch.vertex;
  EyeWalk walk(scene, rules, factors, sampler, tallies);
  walk.start_eye(ray);
  for (;;) {
    const auto event = walk.advance(v, scratch.arena);
    if (event == EyeWalk::Event::ended) break;
    const bool left = event == EyeWalk::Event::left;
    if (kernel.hit_light && (v.edges > 1 || !kernel.hide_emitters) &&
        transport::hit_light<Unweighted>(connect, v, left, nullptr, maps.eta, light))
      sum += light.value;
    if (left) break;
    if (v.connects) {
      sum += transport::merge<Unweighted>(scene, maps, v);
      if (v.kind == transport::Vertex::Kind::medium || (kMaySpecular & scene::bit(v.closure.kind)) == 0)
        break;
    }
    const auto step = walk.scatter(v);
    if (step == EyeWalk::Step::ended || (step == EyeWalk::Step::scattered && !v.left_by_delta)) break;
  }
  return sum;
}

template <Between kBetween>
Result<void> run_kernel(const PpmKernel& kernel, const UnitContext& context, const Unit& unit,
                        film::UnitFilm& film, const RunContext& run) {
  merging::LightPass pass;
  pass.paths = merging::light_path_count(kernel.merge, context);
  pass.surface_photons = kernel.merge_surface;
  pass.medium_photons = kernel.merge_medium;
  pass.caustics_only = kernel.caustics_only;
  transport::WalkRules rules;
  rules.max_edges = kernel.max_depth;
  rules.rr_depth = pass.rules.rr_depth = kernel.rr_depth;
  pass.rules.max_edges = kernel.max_depth - 1;
  return merging::run_iterations<kBetween, Unweighted, Scratch>(
      context, unit, kernel.merge, pass, kernel.merge_surface || kernel.merge_medium, kernel.eye_paths, film,
      run,
      [&](const merging::LightSide& side, const Ray& ray, std::uint64_t /*pixel*/, samplers::Sampler& sampler,
          Scratch& scratch, film::Tallies& tallies) {
        return trace_eye<kBetween>(kernel, rules, context.scene, side.maps, ray, sampler, scratch, tallies);
      });
}

class PpmIntegrator final : public Integrator {
 public:
  PpmIntegrator(const PpmSettings& settings, const scene::SceneFeatures& features) {
    kernel_.max_depth = settings.common.depth();
    kernel_.rr_depth = static_cast<std::uint32_t>(settings.common.rr_depth);
    kernel_.hide_emitters = settings.common.hide_emitters;
    kernel_.choose_emitter = features.emitters > 1 || features.any_mesh_emitter;
    kernel_.merge = settings.merge.rules();
    kernel_.caustics_only = settings.photons.value == "caustics";
    kernel_.hit_light = !kernel_.caustics_only;
    make_plan(settings, features);
  }

  Result<void> run(const UnitContext& context, const Unit& unit, film::UnitFilm& film,
                   const RunContext& run_context) const override {
    return with_between(between_, [&](auto between) {
      return run_kernel<between()>(kernel_, context, unit, film, run_context);
    });
  }

  std::vector<float> pilot_luminances(const UnitContext& context, std::uint32_t count) const override {
    return bidirectional::pilot(context, count, kernel_.max_depth, kernel_.rr_depth, kernel_.choose_emitter,
                                kernel_.hide_emitters);
  }

  const Plan& plan() const override { return plan_; }

 private:
  void make_plan(const PpmSettings& settings, const scene::SceneFeatures& features);

  PpmKernel kernel_;
  Between between_ = Between::media;
  Plan plan_;
};

void PpmIntegrator::make_plan(const PpmSettings& settings, const scene::SceneFeatures& features) {
  if (kernel_.max_depth < 1 || features.emitters == 0) {
    kernel_.eye_paths = kernel_.hit_light = kernel_.merge_surface = kernel_.merge_medium = false;
    plan_.skip("everything",
               features.emitters == 0 ? "the scene has no emitter" : "max_depth 0 is a black image");
    return;
  }
  if (kernel_.max_depth < 2) {
    kernel_.merge_surface = kernel_.merge_medium = false;
    plan_.skip("photons", "max_depth shows emitters only");
    return;
  }
  if (kernel_.caustics_only && !features.any_delta_bsdf) {
    kernel_.eye_paths = kernel_.merge_surface = kernel_.merge_medium = false;
    plan_.skip("everything", "no surface is specular: there are no caustics");
    return;
  }
  note_lasting_media(features, kernel_.max_depth, kernel_.rr_depth, plan_);
  if (settings.common.plan.value == "full") {
    plan_.use("everything", "plan=full");
    return;
  }
  if (kernel_.caustics_only) plan_.skip("photons that no specular vertex sent", "photons=caustics");
  kernel_.hit_light = kernel_.hit_light && (features.any_area_emitter || features.any_environment);
  if (kernel_.hit_light)
    plan_.use("light met by eye paths", "seen directly, or by specular reflection or refraction");
  else if (kernel_.caustics_only)
    plan_.skip("light met by eye paths", "photons=caustics");
  else
    plan_.skip("light met by eye paths", "no emitter has an area, and there is no environment");
  kernel_.merge_surface = !features.all_bsdfs_delta;
  if (kernel_.merge_surface)
    plan_.use("photons on surfaces", "some surface is not specular");
  else
    plan_.skip("photons on surfaces", "every surface scatters specularly");
  kernel_.merge_medium = features.any_scattering_medium;
  if (kernel_.merge_medium)
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
