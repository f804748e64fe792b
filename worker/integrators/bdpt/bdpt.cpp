// The bdpt integrator: settings, plan, and the choice of an estimator (estimators/bidirectional.h) by them.
#include "worker/integrators/bdpt/bdpt.h"

#include "common/film/unit_film.h"
#include "worker/estimators/bidirectional.h"
#include "worker/integrators/bdpt/film_sink.h"
#include "worker/integrators/bidirectional/plan.h"
#include "worker/integrators/eye_samples.h"
#include "worker/integrators/iteration_integrator.h"
#include "worker/integrators/plan_between.h"
#include "worker/integrators/plan_walks.h"

namespace candela::integrators {
namespace {

using bdpt::TechniqueLayers;
using estimators::PathOptions;
using estimators::Techniques;
using transport::Between;
using transport::MisHeuristic;

template <Between kB, class MisT, bool kL>
struct FilmConfig {
  static constexpr Between kBetween = kB;
  static constexpr bool kLists = kL;
  using Mis = MisT;
  using Sampler = samplers::Sampler;
  using Sink = bdpt::FilmSink;
  using Choice = estimators::EveryTechnique;
};

template <class Config>
Result<void> run_kernel(const UnitContext& context, const PathOptions& options, const Techniques& techniques,
                        const TechniqueLayers& layers, const Unit& unit, film::UnitFilm& film,
                        const RunContext& run) {
  const bool signed_values = context.filter.has_negative_lobes();
  // A path from the eye and one from the light for each pixel.
  const double paths = static_cast<double>(context.width) * context.height;
  const estimators::PathCounts counts{paths, paths, static_cast<float>(context.filter.radius())};
  return for_each_tile(
      context.width, context.height, film, run,
      [&](std::uint32_t x0, std::uint32_t y0, std::uint32_t x1, std::uint32_t y1, film::Tallies& tallies) {
        samplers::Sampler eye(context.sampler, context.seed), light(context.sampler, context.seed);
        bdpt::FilmSink sink(context, layers, paths, film, tallies);
        estimators::Bidirectional<Config> estimator(context.scene, options, techniques, counts, sink, tallies,
                                                    context.letters);
        for (std::uint32_t y = y0; y < y1; ++y) {
          for (std::uint32_t x = x0; x < x1; ++x) {
            for (std::uint64_t index = unit.begin; index < unit.end; ++index) {
              if (techniques.light_paths) {
                light.start_light(unit.half, index, std::uint64_t{y} * context.width + x);
                estimator.trace_light(light);
              }
              eye.start(unit.half, index, x, y);
              const EyeRay ray = eye_ray(context, x, y, eye);
              sink.start_eye(x, y, ray.weight, eye.sample_key());
              estimator.trace_eye(ray.ray, eye);
              Spectrum value = sink.sum() * ray.weight;
              if (run.fault != nullptr) run.fault(eye.sample_key(), &value.r);
              const bool kept =
                  film.splat(0, x, y, {value.r, value.g, value.b}, eye.sample_key(), tallies, signed_values);
              if (transport::LayerSums* sums = estimator.layer_sums(); sums != nullptr && kept)
                sums->write(film, x, y, ray.weight, eye.sample_key());
            }
            tallies.eye_samples += unit.end - unit.begin;
            if (run.stopped()) return;
          }
        }
      });
}

using Run = Result<void> (*)(const UnitContext&, const PathOptions&, const Techniques&,
                             const TechniqueLayers&, const Unit&, film::UnitFilm&, const RunContext&);

template <Between kBetween>
Run run_for(MisHeuristic heuristic) {
  switch (heuristic) {
    case MisHeuristic::balance:
      return &run_kernel<FilmConfig<kBetween, transport::Balance, false>>;
    case MisHeuristic::power:
      return &run_kernel<FilmConfig<kBetween, transport::Power, false>>;
    case MisHeuristic::maximum:
    case MisHeuristic::cutoff:
      break;
  }
  return &run_kernel<FilmConfig<kBetween, transport::Balance, true>>;
}

class BdptIntegrator final : public IterationIntegrator {
 public:
  BdptIntegrator(const PathOptions& options, Planned planned, TechniqueLayers layers)
      : IterationIntegrator(options, std::move(planned)), layers_(std::move(layers)) {}

  Result<void> run(const UnitContext& context, const Unit& unit, const UnitInput& /*input*/,
                   UnitOutput& output, const RunContext& run_context) const override {
    const Run chosen =
        with_between(planned_.between, [&](auto between) { return run_for<between()>(options_.heuristic); });
    return chosen(context, options_, planned_.techniques, layers_, unit, *output.film, run_context);
  }

  WorkPlan work(FilmSize /*size*/, const NamedState& /*state*/) const override {
    return {.layers = layers_.names()};
  }

 private:
  const TechniqueLayers layers_;
};

}  // namespace

Result<std::unique_ptr<Integrator>> make_bdpt_integrator(const SettingsMap& settings,
                                                         const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const BdptSettings parsed, parse_settings<BdptSettings>(settings));
  PathOptions options = parsed.common.path_options();
  options.heuristic = heuristic_named(parsed.heuristic.value);
  TechniqueLayers layers;
  if (const std::string& asked = parsed.layers.value; asked != "none" && options.max_depth > 0)
    layers = TechniqueLayers(asked != "unweighted", asked != "weighted",
                             static_cast<std::uint32_t>(parsed.layer_depth), options.max_depth,
                             features.finite_lens);
  const std::size_t layer_count = layers.names().size();
  if (layer_count + 1 > film::kMaxLayers) {
    return usage_error("techniques of paths of " + std::to_string(parsed.layer_depth) + " edges need " +
                       std::to_string(layer_count) + " layers; a film has at most " +
                       std::to_string(film::kMaxLayers - 1))
        .with_field("layer_depth")
        .with_mend("lower layer_depth, or ask for weighted or unweighted layers alone");
  }
  Planned planned = bidirectional::plan(options, features, parsed.common.full_plan());
  note_lasting_media(features, options.max_depth, options.rr_depth, planned.plan);
  return std::unique_ptr<Integrator>(
      std::make_unique<BdptIntegrator>(options, std::move(planned), std::move(layers)));
}

}  // namespace candela::integrators
