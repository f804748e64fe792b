// The loop of bdpt over tiles and samples.
#pragma once

#include "common/film/unit_film.h"
#include "worker/estimators/bidirectional.h"
#include "worker/integrators/bdpt/film_sink.h"
#include "worker/integrators/eye_samples.h"
#include "worker/integrators/regularise.h"

namespace candela::integrators::bdpt {

// Adds the samples of a unit. Config: of Bidirectional; its sink is a FilmSink.
template <class Config>
Result<void> run_kernel(const UnitContext& context, const estimators::PathOptions& options,
                        const estimators::Techniques& techniques, const TechniqueLayers& layers,
                        [[maybe_unused]] const Regularization& regularization, const Unit& unit,
                        film::UnitFilm& film, const RunContext& run) {
  const bool signed_values = context.filter.has_negative_lobes();
  // A path from the eye and one from the light for each pixel.
  const double paths = static_cast<double>(context.width) * context.height;
  const estimators::PathCounts counts{paths, paths, static_cast<float>(context.filter.radius())};
  return for_each_tile(
      context.width, context.height, film, run,
      [&](std::uint32_t x0, std::uint32_t y0, std::uint32_t x1, std::uint32_t y1,
          film::SampleCounts& sample_counts) {
        samplers::Sampler eye(context.sampler, context.seed), light(context.sampler, context.seed);
        typename Config::Sink sink(context, layers, paths, film, sample_counts);
        estimators::Bidirectional<Config> estimator(context.scene, options, techniques, counts, sink,
                                                    sample_counts, context.letters);
        for (std::uint32_t y = y0; y < y1; ++y) {
          for (std::uint32_t x = x0; x < x1; ++x) {
            for (std::uint64_t index = unit.begin; index < unit.end; ++index) {
              if constexpr (estimators::Mollifying<Config>)
                estimator.set_bandwidth(regularization.bandwidth(global_iteration(unit.half, index)));
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
              const bool kept = film.splat(0, x, y, {value.r, value.g, value.b}, eye.sample_key(),
                                           sample_counts, signed_values);
              if (transport::LayerSums* sums = estimator.layer_sums(); sums != nullptr && kept)
                sums->gather(film, ray.weight, eye.sample_key());
            }
            if (transport::LayerSums* sums = estimator.layer_sums(); sums != nullptr)
              sums->write_gathered(film, x, y);
            sample_counts.eye_samples += unit.end - unit.begin;
            if (run.stopped()) return;
          }
        }
      });
}

}  // namespace candela::integrators::bdpt
