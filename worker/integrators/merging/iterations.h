// The iterations of a unit: in each the light paths first, then the photon maps, then an eye path for every
// pixel. What an iteration does depends on its number alone.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "common/stats/inner_merges.h"
#include "worker/estimators/merging_eye.h"
#include "worker/integrators/eye_samples.h"
#include "worker/integrators/merging/iteration_options.h"
#include "worker/integrators/merging/photon_maps.h"
#include "worker/integrators/merging/pixels_alone.h"
#include "worker/integrators/merging/scales.h"

namespace candela::integrators::merging {

// The eye paths of one iteration. EyeEstimator: VcmEye or PpmEye of estimators/merging_eye.h.
template <class EyeEstimator, class LightSide>
Result<void> run_eye_pass(const UnitContext& context, const IterationOptions& options,
                          const estimators::PathCounts& counts, const LightSide& side,
                          const typename EyeEstimator::Statistics& statistics, std::uint32_t half,
                          std::uint64_t index, UnitOutput& output, const RunContext& run, ProgressSpan span) {
  const bool signed_values = context.filter.has_negative_lobes();
  film::UnitFilm& film = *output.film;
  // It follows those of the statistics.
  film::UnitAccumulator* const inner = stats::find_inner_merges(output.accumulators);
  const auto of_statistics = std::span<const std::unique_ptr<film::UnitAccumulator>>(output.accumulators)
                                 .first(output.accumulators.size() - (inner != nullptr ? 1 : 0));
  return for_each_tile(
      context.width, context.height, film, run,
      [&](std::uint32_t x0, std::uint32_t y0, std::uint32_t x1, std::uint32_t y1,
          film::SampleCounts& sample_counts) {
        const PixelsAlone alone(context.width, context.height, context.filter.radius(), x0, y0, x1, y1);
        samplers::Sampler sampler(context.sampler, context.seed);
        EyeEstimator eye(context.scene, options.paths, options.techniques, counts, side, statistics,
                         sample_counts);
        for (std::uint32_t y = y0; y < y1; ++y) {
          for (std::uint32_t x = x0; x < x1; ++x) {
            sampler.start(half, index, x, y);
            const std::uint64_t pixel = std::uint64_t{y} * context.width + x;
            const EyeRay ray = eye_ray(context, x, y, sampler);
            Spectrum value = eye.trace(ray.ray, ray.at, pixel % side.path_count, sampler) * ray.weight;
            if (run.fault != nullptr) run.fault(sampler.sample_key(), &value.r);
            const bool kept = film.add(0, x, y, {value.r, value.g, value.b}, sampler.sample_key(),
                                       sample_counts, signed_values);
            if (inner != nullptr && kept) {
              const Spectrum less = (eye.merged() - eye.merged_within_half()) * ray.weight;
              stats::add_inner_merges(*inner, context.width, context.height, x, y, {less.r, less.g, less.b},
                                      sampler.sample_key());
            }
            if (options.merging_layer && kept) {
              const Spectrum merged = eye.merged() * ray.weight;
              film.add(1, x, y, {merged.r, merged.g, merged.b}, sampler.sample_key(), sample_counts,
                       signed_values);
            }
            if constexpr (requires { eye.shares(); }) {
              if (options.technique_layers && kept) {
                std::uint32_t layer = 0;
                for (const Spectrum& share : eye.shares()) {
                  const Spectrum part = share * ray.weight;
                  film.add(++layer, x, y, {part.r, part.g, part.b}, sampler.sample_key(), sample_counts,
                           signed_values);
                }
              }
            }
            if (transport::LayerSums* sums = eye.layer_sums(); sums != nullptr && kept)
              sums->write(film, x, y, ray.weight, sampler.sample_key());
            if constexpr (EyeEstimator::Statistics::kCollects) {
              // The film follows the filter; statistics follow the radius, that of the position.
              if (kept) {
                const auto [at_x, at_y] = transport::pixel_of(ray.at, context.width, context.height);
                if (!eye.statistics().write(of_statistics, at_x, at_y, ray.weight, sampler.sample_key(),
                                            alone.contains(at_x, at_y))) [[unlikely]]
                  ++sample_counts.rejected[static_cast<std::size_t>(film::RejectCause::statistics)];
              }
            }
          }
          sample_counts.eye_samples += x1 - x0;
          if (run.stopped()) return;
        }
      },
      span);
}

// light: see PhotonMaps. statistics: what every eye path's statistics start as.
template <class EyeEstimator, class Light>
Result<void> run_iterations(const UnitContext& context, const Unit& unit, const IterationOptions& options,
                            Light& light, const typename EyeEstimator::Statistics& statistics,
                            UnitOutput& output, const RunContext& run) {
  const std::uint64_t phases = 2 * (unit.end - unit.begin);
  for (std::uint64_t index = unit.begin; index < unit.end; ++index) {
    const std::uint64_t phase = 2 * (index - unit.begin);
    light.start(global_iteration(unit.half, index));
    if (options.techniques.light_paths)
      CANDELA_TRY(light.trace(unit.half, index, *output.film, run, progress_part(phase, phases)));
    CANDELA_TRY(light.build(run.threads));
    if (options.techniques.eye_paths)
      CANDELA_TRY(
          (run_eye_pass<EyeEstimator>(context, options, light.counts(), light.side(), statistics, unit.half,
                                      index, output, run, progress_part(phase + 1, phases))));
    light.finish();
  }
  return {};
}

// Iterations with one radius for the whole film.
template <class EyeEstimator>
Result<void> run_progressive(const UnitContext& context, const Unit& unit, const UnitInput& input,
                             const IterationOptions& options, UnitOutput& output, const RunContext& run) {
  CANDELA_ASSIGN(const double first, decided_radius(input, options));
  using Scales = const ProgressiveScales<typename EyeEstimator::Mis>;
  Scales scales(options.merge, first, static_cast<double>(light_path_count(options.merge, context)),
                options.techniques);
  PhotonMaps<EyeEstimator, Scales> light(context, options, scales);
  return run_iterations<EyeEstimator>(context, unit, options, light, {}, output, run);
}

}  // namespace candela::integrators::merging
