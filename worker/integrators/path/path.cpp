// Path tracing. A path of depth d has d edges from the camera to the emitter. At each vertex light is
// gathered in two ways: a direction sampled towards an emitter, and the bsdf's own direction should it meet
// one. Both estimate the same integral; each contribution is weighted by the heuristic from the two
// solid-angle densities.
//
// throughput: product of bsdf values times cosines over densities, along the path so far.
// Dimensions: [0] film position, [1] lens, then a block of kBlock draws for each vertex. A draw that nothing
// at the vertex reads is not made. Behind the first kStratifiedVertices vertices that are not specular the
// draws are independent ones: stratifying them gains less than it costs.
//
// Russian roulette from rr_depth on: a path survives with 1 / kRouletteFloor times the probability Mitsuba
// gives it (the throughput's largest component, radiance's 1/eta^2 undone). Where light is hard to find, what
// a few long paths bring is most of the variance, and ending them early with their survivors scaled up makes
// it worse; where it is easy, long paths are only time. The factor is measured (docs/integrators/path.md).
#include "worker/integrators/path/path.h"

#include <cmath>
#include <utility>

#include "worker/integrators/eye_samples.h"

namespace candela::integrators {
namespace {

using scene::Closure;
using scene::DirectSample;
using scene::SurfaceHit;
using scene::TransportMode;

constexpr std::uint32_t kCameraDimensions = 2;
// A vertex's block.
constexpr std::uint32_t kEmitterChoice = 0, kEmitterPoint = 1, kLobe = 2, kDirection = 3, kRoulette = 4,
                        kBlock = 5;
constexpr std::uint32_t kStratifiedVertices = 2;
constexpr float kRouletteFloor = 0.25f;    // throughput below which a path may end
constexpr float kLongestSurvival = 0.95f;  // keeps a path from living for ever where nothing is absorbed

// What the plan decided, as compile-time facts of the kernel.
struct Techniques {
  bool next_event = true;    // sample emitters
  bool hit_emitters = true;  // surfaces may emit
  bool environment = true;   // light may arrive from outside the scene
  bool weigh = true;         // both techniques can find the same light
};

struct Limits {
  std::uint32_t max_depth;
  std::uint32_t rr_depth;
  bool hide_emitters;
  bool power_heuristic;
  bool choose_emitter;  // Scene::sample_direct reads its u_select
};

// The MIS weight of a technique with density p against one of density q, as a ratio so that it neither over-
// nor underflows. [Veach 1997, Eq. 9.8 (balance) and 9.13 (power, beta = 2)]
float mis_weight(float p, float q, bool power) {
  const float ratio = q / p;
  return 1.0f / (1.0f + (power ? ratio * ratio : ratio));
}

template <bool kNextEvent, bool kHitEmitters, bool kEnvironment, bool kWeigh>
Spectrum radiance(const scene::Scene& scene, const Limits& limits, Ray ray, samplers::Sampler& sampler,
                  film::Tallies& tallies) {
  Spectrum sum;
  Spectrum throughput(1.0f);
  float eta_scale = 1;  // squared relative index since the camera: undoes radiance's 1/eta^2 for the roulette
  bool previous_delta = true;  // the camera cannot be sampled from a light
  float previous_pdf_solid_angle = 0;
  SurfaceHit hits[2];             // the edge's end and its start, in turn
  Vec3 front;                     // the previous vertex's shading normal, on the viewer's side
  std::uint32_t scatterings = 0;  // vertices so far that are not specular
  std::uint64_t rays = 0;

  for (std::uint32_t depth = 1; depth <= limits.max_depth; ++depth) {
    SurfaceHit& hit = hits[depth & 1];
    const SurfaceHit& previous = hits[~depth & 1];
    ++rays;
    const bool found = scene.intersect(ray, hit);

    // Light that this edge found by itself.
    if (!found) {
      if constexpr (kEnvironment) {
        if (depth > 1 || !limits.hide_emitters) {
          const Spectrum arriving = scene.environment(ray.direction);
          if (!arriving.is_black()) {
            float weight = 1;
            if (kWeigh && !previous_delta)
              weight = mis_weight(previous_pdf_solid_angle,
                                  scene.pdf_direct_environment_solid_angle(previous, front, ray.direction),
                                  limits.power_heuristic);
            sum += throughput * arriving * weight;
          }
        }
      }
      break;
    }
    const Vec3 wo_world = -ray.direction;
    if constexpr (kHitEmitters) {
      if (hit.emitter != scene::kNone && (depth > 1 || !limits.hide_emitters)) {
        const Spectrum emitted = scene.emitted(hit, wo_world);
        if (!emitted.is_black()) {
          float weight = 1;
          if (kWeigh && !previous_delta)
            weight = mis_weight(previous_pdf_solid_angle,
                                scene.pdf_direct_solid_angle(previous, front, ray.direction, hit),
                                limits.power_heuristic);
          sum += throughput * emitted * weight;
        }
      }
    }
    if (depth == limits.max_depth) break;

    const Closure closure = scene.closure(hit, wo_world);
    if (closure.black) break;
    const Vec3 wo = hit.shading.to_local(wo_world);
    front = wo.z < 0 ? -hit.shading.n : hit.shading.n;
    const std::uint32_t block = kCameraDimensions + (depth - 1) * kBlock;
    const bool stratified = scatterings < kStratifiedVertices;
    scatterings += closure.purely_delta() ? 0 : 1;

    // Next event estimation.
    if constexpr (kNextEvent) {
      DirectSample light;
      float u_emitter = 0;
      if (limits.choose_emitter) u_emitter = sampler.draw_1d(block + kEmitterChoice, stratified);
      if (!closure.purely_delta() &&
          scene.sample_direct(hit, front, u_emitter, sampler.draw_2d(block + kEmitterPoint, stratified),
                              light)) {
        float pdf_solid_angle = 0;
        const Spectrum value =
            closure.eval_pdf(wo, hit.shading.to_local(light.wi), TransportMode::radiance, pdf_solid_angle);
        if (!value.is_black()) {
          ++rays;
          if (!scene.occluded(light.shadow_ray)) {
            float weight = 1 / light.pdf_solid_angle;
            if (kWeigh && !light.delta)
              weight *= mis_weight(light.pdf_solid_angle, pdf_solid_angle, limits.power_heuristic);
            sum += throughput * value * light.radiance * weight;
          }
        }
      }
    }

    // On along the bsdf.
    scene::BsdfSample next;
    const float u_lobe = closure.chooses_lobe() ? sampler.draw_1d(block + kLobe, stratified) : 0.0f;
    if (!closure.sample(wo, u_lobe, sampler.draw_2d(block + kDirection, stratified), TransportMode::radiance,
                        next))
      break;
    throughput *= next.weight;
    if (throughput.is_black()) break;
    eta_scale *= next.eta * next.eta;

    if (depth >= limits.rr_depth) {
      const float survive =
          std::min(throughput.max_component() * eta_scale * (1 / kRouletteFloor), kLongestSurvival);
      if (!(sampler.draw_1d(block + kRoulette, stratified) < survive)) break;
      throughput *= 1 / survive;
    }

    previous_delta = next.delta;
    previous_pdf_solid_angle = next.pdf_solid_angle;
    ray = spawn_ray(hit, hit.shading.to_world(next.wi));
  }
  tallies.rays += rays;
  return sum;
}

using RadianceFunction = Spectrum (*)(const scene::Scene&, const Limits&, Ray, samplers::Sampler&,
                                      film::Tallies&);

template <std::size_t... I>
constexpr auto make_kernels(std::index_sequence<I...>) {
  return std::array<RadianceFunction, sizeof...(I)>{
      &radiance<(I & 1) != 0, (I & 2) != 0, (I & 4) != 0, (I & 8) != 0>...};
}

RadianceFunction kernel_for(const Techniques& t) {
  static constexpr auto kKernels = make_kernels(std::make_index_sequence<16>{});
  return kKernels[std::size_t{t.next_event} | std::size_t{t.hit_emitters} << 1 |
                  std::size_t{t.environment} << 2 | std::size_t{t.weigh} << 3];
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
  } else if (features.all_bsdfs_delta) {
    techniques_.next_event = false;
    plan_.skip("next event estimation",
               "every surface scatters specularly: no sampled light direction can matter");
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
}

}  // namespace

Result<std::unique_ptr<Integrator>> make_path_integrator(const SettingsMap& settings,
                                                         const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const PathSettings parsed, parse_settings<PathSettings>(settings));
  return std::unique_ptr<Integrator>(std::make_unique<PathIntegrator>(parsed, features));
}

}  // namespace candela::integrators
