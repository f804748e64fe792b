// The integrator optimis: settings, work plan, and the tallies of each sample.
#include "worker/integrators/optimis/optimis.h"

#include "common/stages/developments/optimal_mis.h"
#include "worker/estimators/path.h"
#include "worker/integrators/eye_samples.h"
#include "worker/integrators/iteration_integrator.h"
#include "worker/integrators/optimis/plan.h"
#include "worker/integrators/plan_between.h"

namespace candela::integrators {
namespace {

// Words that seed the rounding of a sample's matrix and vector, beside that of its film.
constexpr std::uint64_t kMatrixWord = 1, kVectorWord = 2;

class OptimisIntegrator final : public IterationIntegrator {
  // Calls f(trace), trace(ray, sampler, tallies, first) being the radiance along a ray.
  template <class F>
  auto with_tracer(const UnitContext& context, const F& f) const {
    return with_between(planned_.between, [&](auto between) {
      constexpr transport::Between kBetween = decltype(between)::value;
      using estimators::FirstVertex;
      return f([&](const Ray& ray, samplers::Sampler& sampler, film::Tallies& tallies, FirstVertex& first) {
        if (setup_.techniques() == 0)
          return estimators::PathTracer<kBetween, scene::Scene, samplers::Sampler>(
                     context.scene, options_, planned_.techniques, sampler, tallies)
              .radiance(ray);
        return estimators::PathTracer<kBetween, scene::Scene, samplers::Sampler, FirstVertex>(
                   context.scene, first.options(), planned_.techniques, sampler, tallies, &first)
            .radiance(ray);
      });
    });
  }

 public:
  OptimisIntegrator(const estimators::PathOptions& options, optimis::PlannedFirstVertex planned,
                    std::string estimator)
      : IterationIntegrator(options, std::move(planned.planned)),
        setup_(std::move(planned.setup)),
        estimator_(std::move(estimator)) {}

  WorkPlan work(FilmSize /*size*/, int film_scale_log2) const override {
    WorkPlan plan;
    if (!setup_.controls) return plan;
    const std::size_t n = setup_.techniques();
    plan.accumulators = optimal_mis::accumulators(n, film_scale_log2);
    plan.development = optimal_mis::plan(mis::Allocation::ones(n), estimator_);
    return plan;
  }

  Result<void> run(const UnitContext& context, const Unit& unit, const UnitInput& /*input*/,
                   UnitOutput& output, const RunContext& run) const override {
    return with_tracer(context, [&](const auto& trace) {
      const bool signed_values = context.filter.has_negative_lobes();
      return for_each_tile(context.width, context.height, *output.film, run,
                           [&](std::uint32_t x0, std::uint32_t y0, std::uint32_t x1, std::uint32_t y1,
                               film::Tallies& tallies) {
                             samplers::Sampler sampler(context.sampler, context.seed);
                             estimators::FirstVertex first(setup_, options_);
                             for (std::uint32_t y = y0; y < y1; ++y) {
                               for (std::uint32_t x = x0; x < x1; ++x) {
                                 for (std::uint64_t index = unit.begin; index < unit.end; ++index) {
                                   sampler.start(unit.half, index, x, y);
                                   const EyeRay eye = eye_ray(context, x, y, sampler);
                                   first.start();
                                   Spectrum value = trace(eye.ray, sampler, tallies, first) * eye.weight;
                                   if (run.fault != nullptr) run.fault(sampler.sample_key(), &value.r);
                                   const bool kept =
                                       output.film->add(0, x, y, {value.r, value.g, value.b},
                                                        sampler.sample_key(), tallies, signed_values);
                                   if (first.finish() && setup_.controls)
                                     tally(first.batch(), kept ? static_cast<double>(eye.weight) : 0, x, y,
                                           sampler.sample_key(), output, tallies);
                                 }
                                 tallies.eye_samples += unit.end - unit.begin;
                                 if (run.stop != nullptr && run.stop->load(std::memory_order_relaxed)) return;
                               }
                             }
                           });
    });
  }

  std::vector<float> pilot_luminances(const UnitContext& context, std::uint32_t count) const override {
    return with_tracer(context, [&](const auto& trace) {
      estimators::FirstVertex first(setup_, options_);
      return pilot_eye_samples(context, count,
                               [&](const Ray& ray, samplers::Sampler& sampler, film::Tallies& tallies) {
                                 first.start();
                                 return trace(ray, sampler, tallies, first);
                               });
    });
  }

 private:
  // One batch. A sample that the film refused is a dark one: weight 0.
  void tally(const mis::Sums& batch, double weight, std::uint32_t x, std::uint32_t y, std::uint64_t key,
             UnitOutput& output, film::Tallies& tallies) const {
    const std::size_t n = setup_.techniques();
    output.accumulators[0]->add(x, y, 0, std::span(batch.a).first(mis::packed_size(n)),
                                rng::combine(key, kMatrixWord), tallies);
    std::array<double, mis::kColors * mis::kMaxTechniques> light{};
    bool any = false;
    for (std::size_t k = 0; k < mis::kColors; ++k)
      for (std::size_t i = 0; i < n; ++i) {
        light[k * n + i] = weight == 0 ? 0 : batch.b[k][i] * weight;
        any |= light[k * n + i] != 0;
      }
    if (any)
      output.accumulators[1]->add(x, y, 0, std::span(light).first(mis::kColors * n),
                                  rng::combine(key, kVectorWord), tallies);
  }

  const estimators::FirstVertexSetup setup_;
  const std::string estimator_;
};

}  // namespace

Result<std::unique_ptr<Integrator>> make_optimis_integrator(const SettingsMap& settings,
                                                            const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const OptimisSettings parsed, parse_settings<OptimisSettings>(settings));
  estimators::PathOptions options = parsed.common.path_options();
  options.heuristic = transport::MisHeuristic::power;  // of later vertices: the path tracer's default
  return std::unique_ptr<Integrator>(std::make_unique<OptimisIntegrator>(
      options, optimis::plan(parsed, options, features), parsed.estimator.value));
}

}  // namespace candela::integrators
