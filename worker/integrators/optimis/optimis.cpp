// Path tracing whose direct light at the first vertex that is not specular has optimal weights
// [Kondapaneni 2019], found from the sums of the whole job when its image is read.
// The integrator optimis: settings, work plan, and the sums of each sample.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <type_traits>

#include "common/base/work_monitor.h"
#include "common/film/accumulator_add.h"
#include "common/mis/gain.h"
#include "common/rng/stream.h"
#include "common/stages/developments/optimal_mis.h"
#include "common/stages/epochs.h"
#include "common/stages/light_visibility.h"
#include "worker/estimators/first_vertex_letters.h"
#include "worker/estimators/path_dispatch.h"
#include "worker/integrators/decision_bytes.h"
#include "worker/integrators/eye_samples.h"
#include "worker/integrators/iteration_integrator.h"
#include "worker/integrators/makers.h"
#include "worker/integrators/optimis/plan.h"
#include "worker/integrators/optimis/settings.h"
#include "worker/integrators/plan_edge_content.h"

namespace candela::integrators {
namespace {

using optimis::ReadOut;
using Place = film::UnitAccumulator::Place;

// The word that seeds the rounding of a sample's sums, beside that of its film.
constexpr std::uint64_t kSumsWord = 1;

// The size and the seed of the trial of optimal weights.
constexpr std::uint64_t kTrialPixels = 512;
constexpr std::uint64_t kTrialSeed = 0x747269616cULL;  // "trial"

constexpr std::string_view kKind = "opt1";                          // of the decision,
constexpr std::uint64_t kBalance = 0, kOptimal = 1, kReadings = 2;  // and its number

// The way from a job's samples to the image.
struct Reading {
  estimators::FirstVertexSetup setup;
  ReadOut read_out;
};

class OptimisIntegrator final : public IterationIntegrator {
  // Calls f(trace), trace(ray, sampler, sample_counts, first) being the radiance along a ray.
  template <class F>
  auto with_tracer(const UnitContext& context, const F& f) const {
    return with_edge_content(planned_.between, [&](auto between) {
      constexpr transport::EdgeContent kEdgeContent = decltype(between)::value;
      using estimators::FirstVertex;
      return f([&](const Ray& ray, samplers::Sampler& sampler, film::SampleCounts& sample_counts,
                   FirstVertex& first) {
        if (setup_.techniques() == 0)
          return estimators::PathTracer<kEdgeContent, scene::Scene, samplers::Sampler>(
                     context.scene, options_, planned_.techniques, sampler, sample_counts)
              .radiance(ray);
        return estimators::PathTracer<kEdgeContent, scene::Scene, samplers::Sampler, FirstVertex>(
                   context.scene, first.options(), planned_.techniques, sampler, sample_counts, &first)
            .radiance(ray);
      });
    });
  }
  // The same for jobs with layers by expressions: trace(ray, sampler, sample_counts, first, letters).
  template <class F>
  auto with_lettered_tracer(const UnitContext& context, const F& f) const {
    const auto plain = estimators::path_radiance_with_letters<samplers::Sampler>(planned_.between);
    const auto with_first = estimators::first_vertex_with_letters(planned_.between);
    return f([&, plain, with_first](const Ray& ray, samplers::Sampler& sampler,
                                    film::SampleCounts& sample_counts, estimators::FirstVertex& first,
                                    transport::EyeLetters& letters) {
      if (setup_.techniques() == 0)
        return plain(context.scene, options_, planned_.techniques, ray, sampler, sample_counts, nullptr,
                     &letters);
      return with_first(context.scene, planned_.techniques, ray, sampler, sample_counts, first, letters);
    });
  }
  template <class Trace>
  static constexpr bool kLettered =
      std::is_invocable_v<const Trace&, const Ray&, samplers::Sampler&, film::SampleCounts&,
                          estimators::FirstVertex&, transport::EyeLetters&>;

 public:
  OptimisIntegrator(const OptimisSettings& settings, const estimators::PathOptions& options,
                    optimis::PlannedFirstVertex planned)
      : IterationIntegrator(options, std::move(planned.planned)),
        planned_reading_{planned.setup, planned.read_out},
        balance_{planned.setup, ReadOut::film},
        setup_(planned_reading_.setup),
        lights_(planned.lights),
        on_trial_(planned.on_trial),
        settings_(settings),
        allocation_(mis::Allocation::ones(setup_.techniques())),
        tally_(tally_of(setup_.techniques())) {
    balance_.setup.controls = false;
    if (lights_ > 0)
      epochs_.emplace(static_cast<std::uint64_t>(settings.epoch_min),
                      static_cast<std::uint32_t>(settings.growth));
  }

  Result<Decision> decide(const UnitContext& context, const RunContext& /*run*/) const override {
    Decision decision{{}, plan()};
    if (!on_trial_) return decision;
    const double ratio = trial(context).ratio();
    optimis::tell_trial(ratio, decision.plan);
    DecisionWriter out(kKind);
    out.count(ratio <= optimis::kMaxVariance ? kOptimal : kBalance);
    decision.bytes = out.bytes();
    return decision;
  }

  WorkPlan work(FilmSize size, const NamedState& state) const override {
    const Result<const Reading*> decided = reading(state.decided);
    const ReadOut read_out = (decided.ok() ? **decided : planned_reading_).read_out;
    WorkPlan plan;
    if (read_out == ReadOut::sums) {
      plan.accumulators = pixel_sums::specs(setup_.techniques(), state.film_scale_log2, setup_.groups);
      plan.development = optimal_mis::plan(allocation_, settings_.estimator.value, setup_.groups);
    }
    const light_visibility::Layout layout = light_visibility::layout(size.width, size.height, lights_);
    if (lights_ > 0) {
      plan.accumulators = {light_visibility::spec(layout)};
      plan.epochs = {static_cast<std::uint64_t>(settings_.epoch_min),
                     static_cast<std::uint32_t>(settings_.growth),
                     static_cast<std::uint32_t>(settings_.lag),
                     std::string(light_visibility::kRule),
                     {{std::string(light_visibility::kEntries), std::to_string(layout.entries())},
                      {std::string(light_visibility::kLights), std::to_string(layout.lights)}}};
    }
    return plan;
  }

  Result<void> run(const UnitContext& context, const Unit& unit, const UnitInput& input, UnitOutput& output,
                   const RunContext& run) const override {
    CANDELA_ASSIGN(const Reading* const decided, reading(input.state.decided));
    const Reading& how = *decided;
    std::optional<estimators::LightWeights> lights;
    const light_visibility::Layout layout = light_visibility::layout(context.width, context.height, lights_);
    if (lights_ > 0) {
      CANDELA_ASSIGN(const std::span<const std::uint8_t> weights, light_weights(input, layout));
      if (!weights.empty()) lights.emplace(context.scene.lights().extent(), layout, weights);
    }
    const std::optional<scene::LightGroups> groups = light_groups(context);
    const auto run_all = [&]<class Trace>(const Trace& trace) {
      // Light weights of an epoch are from earlier ones: they have to be independent. One half's
      // samples of all epochs are one sequence of the sampler, those of different words are not.
      const std::uint32_t word =
          unit.half + (epochs_ ? 2 * static_cast<std::uint32_t>(epochs_->of_index(unit.begin)) : 0);
      return for_each_tile(context.width, context.height, *output.film, run,
                           [&](std::uint32_t x0, std::uint32_t y0, std::uint32_t x1, std::uint32_t y1,
                               film::SampleCounts& sample_counts) {
                             samplers::Sampler sampler(context.sampler, context.seed);
                             estimators::FirstVertex first(how.setup, options_, lights ? &*lights : nullptr,
                                                           groups ? &*groups : nullptr);
                             std::optional<transport::EyeLetters> letters;
                             if constexpr (kLettered<Trace>) letters.emplace(*context.letters);
                             const Iteration iteration{
                                 context, unit,          how,     word,  run,
                                 output,  sample_counts, sampler, first, letters ? &*letters : nullptr,
                                 layout};
                             for (std::uint32_t y = y0; y < y1; ++y) {
                               for (std::uint32_t x = x0; x < x1; ++x) {
                                 const Place at = place(output, x, y);
                                 for (std::uint64_t index = unit.begin; index < unit.end; ++index) {
                                   if (run.stopped()) return;
                                   render(iteration, trace, index, at);
                                 }
                                 if constexpr (kLettered<Trace>)
                                   letters->sums().write_gathered(*output.film, x, y);
                                 sample_counts.eye_samples += unit.end - unit.begin;
                               }
                             }
                           });
    };
    return context.letters != nullptr ? with_lettered_tracer(context, run_all)
                                      : with_tracer(context, run_all);
  }

  std::vector<float> pilot_luminances(const UnitContext& context, std::uint32_t count) const override {
    const std::optional<scene::LightGroups> groups = light_groups(context);
    return with_tracer(context, [&](const auto& trace) {
      estimators::FirstVertex first(setup_, options_, nullptr, groups ? &*groups : nullptr);
      return pilot_eye_samples(
          context, count, [&](const Ray& ray, samplers::Sampler& sampler, film::SampleCounts& sample_counts) {
            first.start();
            return trace(ray, sampler, sample_counts, first);
          });
    });
  }

 private:
  // That which the pilot decided. Fails (input) on other bytes.
  Result<const Reading*> reading(std::string_view decided) const {
    if (!on_trial_) return &planned_reading_;
    DecisionReader in(decided, kKind);
    const std::uint64_t number = in.count(kReadings);
    CANDELA_TRY(in.done());
    return number == kOptimal ? &planned_reading_ : &balance_;
  }
  std::optional<scene::LightGroups> light_groups(const UnitContext& context) const {
    if (setup_.groups == 1) return std::nullopt;
    return std::make_optional<scene::LightGroups>(context.scene.lights(), setup_.partition);
  }
  // Weights of the unit's epoch; empty: the choice stays untrained.
  static Result<std::span<const std::uint8_t>> light_weights(const UnitInput& input,
                                                             const light_visibility::Layout& layout) {
    const auto state = input.states.find(light_visibility::kRule);
    const auto bad = [&](std::string_view what) {
      return input_error(fmt::format("the state '{}' {}", light_visibility::kRule, what))
          .with_field("states");
    };
    if (state == input.states.end()) return bad("of the unit's epoch is missing");
    const std::string_view bytes = state->second;
    if (bytes.empty()) return std::span<const std::uint8_t>();
    if (bytes.size() != layout.entries())
      return bad(fmt::format("has {} bytes, not {}", bytes.size(), layout.entries()));
    const std::span weights(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
    if (std::any_of(weights.begin(), weights.end(),
                    [](std::uint8_t w) { return w < light_visibility::kMinWeight; }))
      return bad("leaves a light out");
    return weights;
  }

  // Samples direct light in random pixels of the film. The result does not depend on the job's seed. Each
  // group of lights counts as a pixel of its own.
  mis::Variances trial(const UnitContext& context) const {
    const std::optional<scene::LightGroups> groups = light_groups(context);
    estimators::FirstVertexSetup setup = setup_;
    setup.direct_only = true;
    mis::Variances sum;
    with_tracer(context, [&](const auto& trace) {
      estimators::FirstVertex first(setup, options_, nullptr, groups ? &*groups : nullptr);
      samplers::Sampler sampler(samplers::SamplerKind::independent, kTrialSeed);
      film::SampleCounts unread;
      std::vector<mis::PixelBatches> pixel(setup.groups, mis::PixelBatches(allocation_));
      for (std::uint64_t p = 0; p < kTrialPixels; ++p) {
        work_step();
        rng::Stream place(rng::key(kTrialSeed, p));
        const auto x = static_cast<std::uint32_t>(place.next_double() * context.width),
                   y = static_cast<std::uint32_t>(place.next_double() * context.height);
        for (mis::PixelBatches& batches : pixel) batches.clear();
        for (std::uint64_t i = 0; i < 2 * optimis::kTrialIterations; ++i) {
          sampler.start(0, p * 2 * optimis::kTrialIterations + i, x, y);
          const EyeRay eye = eye_ray(context, x, y, sampler);
          first.start();
          trace(eye.ray, sampler, unread, first);
          if (!first.reached()) continue;
          for (std::size_t g = 0; g < setup.groups; ++g) {
            mis::Sums batch;
            add_weighted(batch, mis::sums_of(setup.techniques(), first.batch(g)), eye.weight);
            pixel[g].add(i % 2, batch);
          }
        }
        for (const mis::PixelBatches& batches : pixel) {
          const mis::Variances more = batches.variances(pixel_sums::kMatrixScale);
          if (std::isfinite(more.balance) && std::isfinite(more.crossfit)) sum.add(more);
        }
      }
    });
    return sum;
  }

  struct Iteration {
    const UnitContext& context;
    const Unit& unit;
    const Reading& how;
    std::uint32_t sequence;  // the sampler's, beside seed and pixel
    const RunContext& run;
    UnitOutput& output;
    film::SampleCounts& sample_counts;
    samplers::Sampler& sampler;
    estimators::FirstVertex& first;
    transport::EyeLetters* letters;          // of traces with letters
    const light_visibility::Layout& layout;  // of the light weights
  };

  // A pixel of the film, and of the sums if there are any.
  static Place place(const UnitOutput& output, std::uint32_t x, std::uint32_t y) {
    return output.accumulators.empty() ? Place{x, y} : output.accumulators[0]->place(x, y);
  }
  // One iteration of a pixel.
  template <class Trace>
  void render(const Iteration& i, const Trace& trace, std::uint64_t index, const Place& at) const {
    const std::uint32_t x = at.x, y = at.y;
    i.sampler.start(i.sequence, index, x, y);
    const EyeRay eye = eye_ray(i.context, x, y, i.sampler);
    i.first.start();
    const std::uint64_t key = i.sampler.sample_key();
    Spectrum light = [&] {
      if constexpr (kLettered<Trace>) {
        i.letters->begin(key, eye.ray);
        return trace(eye.ray, i.sampler, i.sample_counts, i.first, *i.letters);
      } else {
        return trace(eye.ray, i.sampler, i.sample_counts, i.first);
      }
    }() * eye.weight;
    if (i.run.fault != nullptr) i.run.fault(key, &light.r);
    const bool signed_values = i.context.filter.has_negative_lobes();
    const bool kept =
        i.output.film->add(0, x, y, {light.r, light.g, light.b}, key, i.sample_counts, signed_values);
    if constexpr (kLettered<Trace>) {
      if (kept) i.letters->sums().gather(*i.output.film, eye.weight, key);
    }
    if (!i.first.reached()) return;
    tally_visibility(i, key);
    // Samples that the film rejected count as zero.
    const double kept_weight = kept ? static_cast<double>(eye.weight) : 0;
    if (i.how.read_out == ReadOut::sums)
      for (std::size_t g = 0; g < setup_.groups; ++g) tally_(i, g, kept_weight, at, key);
  }

  static void tally_visibility(const Iteration& i, std::uint64_t key) {
    for (const estimators::FirstVertex::ShadowTest& test : i.first.shadow_tests()) {
      const auto at = film::place_of_entry(test.entry);
      const std::array<double, 2> counts = {1, test.seen ? 1.0 : 0.0};
      i.output.accumulators[0]->splat(at.x, at.y, 0, counts, key, i.sample_counts);
    }
  }
  static void add_weighted(mis::Sums& to, mis::Sums more, float weight) {
    for (mis::Vector& color : more.b)
      for (double& b : color) b *= static_cast<double>(weight);
    to.add(more);
  }

  // One batch, of a group of lights.
  template <std::size_t kTechniques>
  static void tally(const Iteration& i, std::size_t group, double weight, const Place& at,
                    std::uint64_t key) {
    const mis::Batch& batch = i.first.batch(group);
    const auto* accumulators = &i.output.accumulators[2 * group];
    // All accumulators share it: errors of rounding that are correlated bias none.
    const std::uint64_t sums_key = rng::combine(key, kSumsWord);
    const std::uint64_t word = film::dither_word(sums_key);
    constexpr std::uint32_t kMatrix = pixel_sums::matrix_channels(kTechniques),
                            kVector = pixel_sums::vector_channels(kTechniques);
    accumulators[0]->template add_array<kMatrix>(at, 0, mis::matrix_of<kTechniques>(batch), sums_key, word,
                                                 i.sample_counts);
    if (weight == 0 || !batch.lit) return;
    auto light = mis::vector_of<kTechniques>(batch);
    for (double& b : light) b *= weight;
    accumulators[1]->template add_array<kVector>(at, 0, light, sums_key, word, i.sample_counts);
  }
  using Tally = decltype(&tally<2>);
  static Tally tally_of(std::size_t techniques) {
    static_assert(mis::kMaxTechniques == 8);
    constexpr std::array<Tally, 7> kTallies = {&tally<2>, &tally<3>, &tally<4>, &tally<5>,
                                               &tally<6>, &tally<7>, &tally<8>};
    return techniques < 2 ? nullptr : kTallies[techniques - 2];
  }

  const Reading planned_reading_;              // if a trial does not find otherwise
  Reading balance_;                            // if it does
  const estimators::FirstVertexSetup& setup_;  // what all readings have in common
  const std::uint32_t lights_;                 // whose visibility is learned
  const bool on_trial_;                        // decide() chooses a reading
  const OptimisSettings settings_;
  const mis::Allocation allocation_;
  const Tally tally_;             // of optimal weights
  std::optional<Epochs> epochs_;  // of trained
};

}  // namespace

Result<void> check(const OptimisSettings& settings) {
  const std::size_t selections = settings.selection.values.size(),
                    points = settings.techniques.values.size() - (settings.techniques.has("bsdf") ? 1 : 0),
                    n = selections * points + 1;  // a plan may add bsdf sampling
  // Sums of epochs whose techniques have other densities make no common system.
  if (settings.selection.has("trained")) {
    const bool optimal = settings.weights.value == "optimal";
    if (optimal || settings.estimator.value != "crossfit")
      return usage_error(
                 fmt::format("'{}' has no part in selection=trained, whose densities differ from epoch "
                             "to epoch",
                             optimal ? settings.weights.value : settings.estimator.value))
          .with_field(optimal ? "weights" : "estimator")
          .with_mend("leave it out, or 'trained'");
  }
  if (settings.light_groups.value != "one" && settings.selection.has("trained"))
    return usage_error(fmt::format("'trained' has all lights in one group, not light_groups={}",
                                   settings.light_groups.value))
        .with_field("selection")
        .with_mend("leave it or light_groups out");
  if (n <= mis::kMaxTechniques) return {};
  return usage_error(
             fmt::format("{} ways of sampling points times {} selections, and bsdf, are {} techniques; "
                         "at most {} fit",
                         points, selections, n, mis::kMaxTechniques))
      .with_field("techniques")
      .with_mend("name fewer of 'techniques' or of 'selection'");
}

Result<std::unique_ptr<Integrator>> make_optimis_integrator(const SettingsMap& settings,
                                                            const scene::SceneFeatures& features) {
  CANDELA_ASSIGN(const OptimisSettings parsed, parse_settings<OptimisSettings>(settings));
  CANDELA_TRY(check(parsed));
  estimators::PathOptions options = parsed.common.path_options();
  options.heuristic = transport::MisHeuristic::power;  // of later vertices: the path tracer's default
  if (parsed.epoch_min % 2 != 0)
    return usage_error(fmt::format("'{}' is not an even number", parsed.epoch_min))
        .with_field("epoch_min")
        .with_mend("an epoch has as many iterations of either half of a job");
  CANDELA_ASSIGN(optimis::PlannedFirstVertex planned, optimis::plan(parsed, options, features));
  return std::unique_ptr<Integrator>(
      std::make_unique<OptimisIntegrator>(parsed, options, std::move(planned)));
}

}  // namespace candela::integrators
