// The iterations of a unit: in each the light paths first, then the photon maps, then an eye path for every
// pixel. What an iteration does depends on its number alone.
#pragma once

#include <cstdint>
#include <vector>

#include "worker/integrators/eye_samples.h"
#include "worker/integrators/merging/first_radius.h"
#include "worker/integrators/merging/light_pass.h"
#include "worker/integrators/merging/rules.h"
#include "worker/transport/merge.h"
#include "worker/transport/radius.h"

namespace candela::integrators::merging {

inline std::uint64_t light_path_count(const MergeRules& rules, const UnitContext& context) {
  const double pixels = static_cast<double>(context.width) * context.height;
  return static_cast<std::uint64_t>(std::max(1.0, std::floor(rules.light_paths * pixels + 0.5)));
}

// What eye paths of an iteration find.
struct LightSide {
  transport::MergeMaps maps;
  const std::vector<LightChunk>& chunks;
};

// trace_eye(light_side, ray, pixel, sampler, scratch, tallies) returns the radiance along the ray; each
// thread has a Scratch of its own. pass.eta is set here. light, eye: whether there are such paths.
template <transport::Between kBetween, class Heuristic, class Scratch, class TraceEye>
Result<void> run_iterations(const UnitContext& context, const Unit& unit, const MergeRules& rules,
                            LightPass& pass, bool light, bool eye, film::UnitFilm& film,
                            const RunContext& run, const TraceEye& trace_eye) {
  const bool merges = pass.surface_photons || pass.medium_photons;
  const double first = merges ? first_radius(context, rules.radius, rules.radius_pixels) : 1;
  const auto paths = static_cast<double>(pass.paths);
  const bool signed_values = context.filter.has_negative_lobes();
  const std::uint64_t phases = 2 * (unit.end - unit.begin);
  std::vector<LightChunk> chunks;
  transport::PhotonMap surface, medium;
  for (std::uint64_t index = unit.begin; index < unit.end; ++index) {
    const std::uint64_t phase = 2 * (index - unit.begin);
    const std::uint64_t iteration = global_iteration(unit.half, index);
    const double disc = transport::disc_radius(first, iteration, rules.alpha);
    const double ball = transport::ball_radius(first, iteration, rules.alpha);
    LightSide side{{rules.kernel, static_cast<float>(disc), static_cast<float>(ball)}, chunks};
    side.maps.max_edges = pass.rules.max_edges + 1;
    side.maps.per_path = static_cast<float>(1 / paths);
    if (pass.surface_photons)
      side.maps.eta.surface = Heuristic::raise(paths * transport::effective_area(rules.kernel, disc));
    if (pass.medium_photons)
      side.maps.eta.medium = Heuristic::raise(paths * transport::effective_volume(rules.kernel, ball));
    pass.eta = side.maps.eta;
    if (light)
      CANDELA_TRY((run_light_pass<kBetween, Heuristic>(pass, context, unit.half, index, chunks, film, run,
                                                       progress_part(phase, phases))));
    if (pass.surface_photons) {
      CANDELA_TRY(
          build_photon_map(chunks, &LightChunk::surface, side.maps.disc_radius, run.threads, surface));
      side.maps.surface = &surface;
    }
    if (pass.medium_photons) {
      CANDELA_TRY(build_photon_map(chunks, &LightChunk::medium, side.maps.ball_radius, run.threads, medium));
      side.maps.medium = &medium;
    }
    if (!eye) continue;
    CANDELA_TRY(for_each_tile(
        context.width, context.height, film, run,
        [&](std::uint32_t x0, std::uint32_t y0, std::uint32_t x1, std::uint32_t y1, film::Tallies& tallies) {
          samplers::Sampler sampler(context.sampler, context.seed);
          Scratch scratch;
          for (std::uint32_t y = y0; y < y1; ++y) {
            for (std::uint32_t x = x0; x < x1; ++x) {
              sampler.start(unit.half, index, x, y);
              const std::uint64_t pixel = std::uint64_t{y} * context.width + x;
              Spectrum value =
                  eye_sample(context, x, y, sampler, tallies,
                             [&](const Ray& ray, samplers::Sampler& draws, film::Tallies& counts) {
                               return trace_eye(side, ray, pixel, draws, scratch, counts);
                             });
              if (run.fault != nullptr) run.fault(sampler.sample_key(), &value.r);
              film.add(0, x, y, {value.r, value.g, value.b}, sampler.sample_key(), tallies, signed_values);
            }
            tallies.eye_samples += x1 - x0;
            if (run.stop != nullptr && run.stop->load(std::memory_order_relaxed)) return;
          }
        },
        progress_part(phase + 1, phases)));
  }
  return {};
}

}  // namespace candela::integrators::merging
