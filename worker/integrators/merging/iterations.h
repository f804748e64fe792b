// The iterations of a unit: in each the light paths first, then the photon maps, then an eye path for every
// pixel. What an iteration does depends on its number alone.
#pragma once

#include <cstdint>
#include <vector>

#include "worker/estimators/merging_eye.h"
#include "worker/integrators/eye_samples.h"
#include "worker/integrators/merging/first_radius.h"
#include "worker/integrators/merging/light_pass.h"
#include "worker/integrators/merging/rules.h"
#include "worker/transport/radius.h"

namespace candela::integrators::merging {

// Options of an integrator of the family, the same for all iterations.
struct IterationOptions {
  estimators::PathOptions paths;
  estimators::Techniques techniques;
  MergeRules merge;
  bool caustics_only = false;  // see LightKeeping
};

inline std::uint64_t light_path_count(const MergeRules& rules, const UnitContext& context) {
  const double pixels = static_cast<double>(context.width) * context.height;
  return static_cast<std::uint64_t>(std::max(1.0, std::floor(rules.light_paths * pixels + 0.5)));
}

// The eye paths of one iteration. EyeEstimator: VcmEye or PpmEye of estimators/merging_eye.h.
template <class EyeEstimator, class LightSide>
Result<void> run_eye_pass(const UnitContext& context, const IterationOptions& options,
                          const estimators::PathCounts& counts, const LightSide& side, std::uint32_t half,
                          std::uint64_t index, film::UnitFilm& film, const RunContext& run,
                          ProgressSpan span) {
  const bool signed_values = context.filter.has_negative_lobes();
  return for_each_tile(
      context.width, context.height, film, run,
      [&](std::uint32_t x0, std::uint32_t y0, std::uint32_t x1, std::uint32_t y1, film::Tallies& tallies) {
        samplers::Sampler sampler(context.sampler, context.seed);
        EyeEstimator eye(context.scene, options.paths, options.techniques, counts, side, tallies);
        for (std::uint32_t y = y0; y < y1; ++y) {
          for (std::uint32_t x = x0; x < x1; ++x) {
            sampler.start(half, index, x, y);
            const std::uint64_t pixel = std::uint64_t{y} * context.width + x;
            const EyeRay ray = eye_ray(context, x, y, sampler);
            Spectrum value = eye.trace(ray.ray, ray.at, pixel % side.path_count, sampler) * ray.weight;
            if (run.fault != nullptr) run.fault(sampler.sample_key(), &value.r);
            film.add(0, x, y, {value.r, value.g, value.b}, sampler.sample_key(), tallies, signed_values);
          }
          tallies.eye_samples += x1 - x0;
          if (run.stop != nullptr && run.stop->load(std::memory_order_relaxed)) return;
        }
      },
      span);
}

template <class EyeEstimator>
Result<void> run_iterations(const UnitContext& context, const Unit& unit, const IterationOptions& options,
                            film::UnitFilm& film, const RunContext& run) {
  using Mis = typename EyeEstimator::Mis;
  using Block = typename Mis::Block;
  constexpr transport::Between kBetween = EyeEstimator::EyeWalk::kContent;
  const MergeRules& rules = options.merge;
  const estimators::Techniques& techniques = options.techniques;
  const double first = techniques.merges() ? first_radius(context, rules.radius, rules.radius_pixels) : 1;
  const std::uint64_t path_count = light_path_count(rules, context);
  const auto paths = static_cast<double>(path_count);
  const estimators::PathCounts counts{static_cast<double>(context.width) * context.height, paths,
                                      static_cast<float>(context.filter.radius())};
  const estimators::LightKeeping keeping{techniques.connect, techniques.merge_surface,
                                         techniques.merge_medium, options.caustics_only};
  const std::uint64_t phases = 2 * (unit.end - unit.begin);
  LightChunks<Block> chunks;
  transport::PhotonMap<Block> surface, medium;
  for (std::uint64_t index = unit.begin; index < unit.end; ++index) {
    const std::uint64_t phase = 2 * (index - unit.begin);
    const std::uint64_t iteration = global_iteration(unit.half, index);
    const double disc = transport::disc_radius(first, iteration, rules.alpha);
    const double ball = transport::ball_radius(first, iteration, rules.alpha);
    estimators::LightSide<Block, transport::ConstantEta> side{
        {rules.kernel, static_cast<float>(disc), static_cast<float>(ball)}, chunks, path_count, {}};
    side.maps.max_edges = options.paths.max_depth;
    side.maps.per_path = static_cast<float>(1 / paths);
    if (techniques.merge_surface)
      side.eta.factors.surface = Mis::raise(paths * transport::effective_area(rules.kernel, disc));
    if (techniques.merge_medium)
      side.eta.factors.medium = Mis::raise(paths * transport::effective_volume(rules.kernel, ball));
    if (techniques.light_paths)
      CANDELA_TRY(
          (run_light_pass<kBetween, Mis>(context, options.paths, techniques, counts, keeping, side.eta,
                                         unit.half, index, chunks, film, run, progress_part(phase, phases))));
    if (techniques.merge_surface) {
      CANDELA_TRY(build_photon_map(chunks, &estimators::LightStore<Block>::surface, side.maps.disc_radius,
                                   run.threads, surface));
      side.maps.surface = &surface;
    }
    if (techniques.merge_medium) {
      CANDELA_TRY(build_photon_map(chunks, &estimators::LightStore<Block>::medium, side.maps.ball_radius,
                                   run.threads, medium));
      side.maps.medium = &medium;
    }
    if (techniques.eye_paths)
      CANDELA_TRY((run_eye_pass<EyeEstimator>(context, options, counts, side, unit.half, index, film, run,
                                              progress_part(phase + 1, phases))));
  }
  return {};
}

}  // namespace candela::integrators::merging
