#include "worker/integrators/light/light.h"

#include "worker/integrators/bidirectional/eye_radiance.h"
#include "worker/integrators/bidirectional/pilot.h"
#include "worker/integrators/eye_samples.h"
#include "worker/integrators/light_paths.h"
#include "worker/integrators/plan_between.h"
#include "worker/integrators/plan_walks.h"
#include "worker/transport/splat.h"

namespace candela::integrators {
namespace {

using transport::Between;
using transport::Contribution;
using transport::FilmPosition;
using transport::TransportMode;
using transport::Vertex;
using transport::WalkRules;

struct LightKernel {
  std::uint32_t max_depth = 0;
  std::uint32_t rr_depth = 0;
  bool hide_emitters = false;
  bool choose_emitter = true;
  bool light_image = true, hit_lens = true, eye_rays = true;

  WalkRules light_rules(const UnitContext& context) const {
    WalkRules rules;
    rules.max_edges = max_depth - 1;
    rules.rr_depth = rr_depth;
    rules.meets_lens = hit_lens;
    rules.film_border = static_cast<float>(context.filter.radius());
    rules.eye_paths = static_cast<double>(context.width) * context.height;
    return rules;
  }
};

// One light path. Both techniques can find the same light through a finite lens; they are weighed.
template <Between kBetween, class Heuristic>
void trace(const LightKernel& kernel, const UnitContext& context, const WalkRules& rules,
           const transport::Splatter& splatter, std::uint64_t light_paths, samplers::Sampler& sampler,
           film::Tallies& tallies) {
  using LightWalk = transport::Walk<TransportMode::importance, kBetween, Heuristic>;
  const auto n = static_cast<double>(light_paths);
  const auto each = static_cast<float>(1 / n);
  const transport::MisFactors factors{0, 0, 0, kernel.light_image ? Heuristic::raise(n) : 0,
                                      kernel.hit_lens ? Heuristic::raise(n) : 0};
  const transport::ConnectContext connect{context.scene, factors, rules, tallies};
  const transport::MergeFactors no_merging;
  LightWalk walk(context.scene, rules, factors, sampler, tallies);
  if (!walk.start_light()) return;
  Vertex v;
  scene::ClosureArena arena;
  for (std::uint64_t key = sampler.sample_key();; key = rng::combine(key, 1)) {
    const auto event = walk.advance(v, arena);
    FilmPosition film;
    Contribution light;
    if (walk.lens().met) {
      light = transport::hit_lens<Heuristic>(connect, walk, no_merging, film);
      if (light.weight > 0) splatter.splat(0, film, light.weighted() * each, rng::combine(key, 2), tallies);
    }
    if (event != LightWalk::Event::vertex) return;
    if (kernel.light_image && v.connects &&
        transport::connect_lens<kBetween, Heuristic>(connect, sampler, walk.block(), walk.stratified(), v,
                                                     no_merging, film, light))
      splatter.splat(0, film, light.weighted() * each, rng::combine(key, 3), tallies);
    if (walk.scatter(v) == LightWalk::Step::ended) return;
  }
}

// Emitters seen by the camera, straight through what passes light on.
template <Between kBetween>
Spectrum seen_directly(const LightKernel& kernel, const scene::Scene& scene, const Ray& ray,
                       samplers::Sampler& sampler, film::Tallies& tallies) {
  WalkRules rules;
  rules.max_edges = 1;
  rules.rr_depth = kernel.rr_depth;
  return bidirectional::eye_radiance<kBetween>(scene, rules, false, false, ray, sampler, tallies);
}

template <Between kBetween>
Result<void> run_kernel(const LightKernel& kernel, const UnitContext& context, const Unit& unit,
                        film::UnitFilm& film, const RunContext& run) {
  if (kernel.eye_rays) {
    CANDELA_TRY(run_eye_samples(
        context, unit, film, run, [&](const Ray& ray, samplers::Sampler& sampler, film::Tallies& tallies) {
          return seen_directly<kBetween>(kernel, context.scene, ray, sampler, tallies);
        }));
  }
  if (!kernel.light_image && !kernel.hit_lens) return {};
  const WalkRules rules = kernel.light_rules(context);
  const std::uint64_t light_paths = std::uint64_t{context.width} * context.height;
  const transport::Splatter splatter(context.filter, film, context.width, context.height);
  return run_light_paths(context, unit, light_paths, film, run,
                         [&](std::uint64_t, samplers::Sampler& sampler, film::Tallies& tallies) {
                           if (kernel.hit_lens)
                             trace<kBetween, transport::Balance>(kernel, context, rules, splatter,
                                                                 light_paths, sampler, tallies);
                           else
                             trace<kBetween, transport::Unweighted>(kernel, context, rules, splatter,
                                                                    light_paths, sampler, tallies);
                         });
}

class LightIntegrator final : public Integrator {
 public:
  LightIntegrator(const LightSettings& settings, const scene::SceneFeatures& features) {
    kernel_.max_depth = settings.max_depth < 0 ? 1u << 30 : static_cast<std::uint32_t>(settings.max_depth);
    kernel_.rr_depth = static_cast<std::uint32_t>(settings.rr_depth);
    kernel_.hide_emitters = settings.hide_emitters;
    kernel_.choose_emitter = features.emitters > 1 || features.any_mesh_emitter;
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
  void make_plan(const LightSettings& settings, const scene::SceneFeatures& features);

  LightKernel kernel_;
  Between between_ = Between::media;
  Plan plan_;
};

void LightIntegrator::make_plan(const LightSettings& settings, const scene::SceneFeatures& features) {
  if (kernel_.max_depth < 1) {
    kernel_.eye_rays = kernel_.light_image = kernel_.hit_lens = false;
    plan_.skip("everything", "max_depth 0 is a black image");
    return;
  }
  if (kernel_.max_depth < 2) kernel_.light_image = kernel_.hit_lens = false;
  if (kernel_.hide_emitters) kernel_.eye_rays = false;
  if (features.emitters == 0) kernel_.light_image = kernel_.hit_lens = false;
  note_lasting_media(features, kernel_.max_depth, kernel_.rr_depth, plan_);
  if (settings.plan.value == "full") {
    plan_.use("everything", "plan=full");
    return;
  }
  if (!features.any_area_emitter && !features.any_environment && kernel_.eye_rays) {
    kernel_.eye_rays = false;
    plan_.skip("eye rays", "no emitter can be seen directly");
  } else if (kernel_.eye_rays) {
    plan_.use("eye rays", "emitters seen directly");
  } else {
    plan_.skip("eye rays", "hide_emitters");
  }
  if (kernel_.light_image && features.all_bsdfs_delta && !features.any_scattering_medium) {
    kernel_.light_image = false;
    plan_.skip("connections to the lens", "every surface scatters specularly");
  } else if (kernel_.light_image) {
    plan_.use("connections to the lens", "light paths scatter where the camera may see it");
  } else {
    plan_.skip("connections to the lens", "no light paths");
  }
  if (!features.finite_lens && kernel_.hit_lens) {
    kernel_.hit_lens = false;
    plan_.skip("light that meets the lens", "the lens is a point, or infinitely far");
  } else if (kernel_.hit_lens) {
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
