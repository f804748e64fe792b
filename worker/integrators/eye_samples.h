// The loop that every integrator of the "one radiance per eye sample" kind shares: tiles over threads,
// iterations of the unit innermost (the scene stays in cache), each sample named by (seed, half, index,
// pixel) and added once.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <type_traits>
#include <vector>

#include "common/base/work_monitor.h"
#include "worker/integrators/integrator.h"
#include "worker/integrators/parallel_tasks.h"
#include "worker/scene/scene.h"
#include "worker/transport/film_position.h"
#include "worker/transport/letters/layer_sums.h"

namespace candela::integrators {

// Runs body(tile_x0, tile_y0, tile_x1, tile_y1, sample_counts) for every tile of the film, as for_each_task.
template <class Body>
Result<void> for_each_tile(std::uint32_t width, std::uint32_t height, film::UnitFilm& film,
                           const RunContext& run, const Body& body, ProgressSpan span = {}) {
  constexpr std::uint32_t kTile = film::kTileSize;
  const std::uint32_t tiles_x = (width + kTile - 1) / kTile;
  const std::uint32_t tiles_y = (height + kTile - 1) / kTile;
  return for_each_task(
      std::uint64_t{tiles_x} * tiles_y, film, run,
      [&](std::uint64_t tile, film::SampleCounts& sample_counts) {
        const auto x0 = static_cast<std::uint32_t>(tile % tiles_x) * kTile;
        const auto y0 = static_cast<std::uint32_t>(tile / tiles_x) * kTile;
        body(x0, y0, std::min(x0 + kTile, width), std::min(y0 + kTile, height), sample_counts);
      },
      span);
}

struct EyeRay {
  Ray ray;
  float weight;  // of the filter and the sensor
  transport::FilmPosition at;
};

// The ray of an eye sample. Draws dimensions 0 (film position) and, where the lens is finite, 1.
inline EyeRay eye_ray(const UnitContext& context, std::uint32_t x, std::uint32_t y,
                      samplers::Sampler& sampler) {
  sampler.set_dimension(0);
  float filter_weight = 1;
  const Vec2 offset = context.filter.sample(sampler.next_2d(), filter_weight);
  float response = 1;
  const transport::FilmPosition at{static_cast<float>(x) + 0.5f + offset.x,
                                   static_cast<float>(y) + 0.5f + offset.y};
  const Ray ray =
      context.scene.camera_ray(at.x * context.camera_units.x, at.y * context.camera_units.y,
                               context.scene.reads_lens() ? sampler.next_2d() : Vec2{0.5f, 0.5f}, response);
  return {ray, filter_weight * response, at};
}

// One eye sample: filter position, camera ray, radiance.
template <class Radiance>
Spectrum eye_sample(const UnitContext& context, std::uint32_t x, std::uint32_t y, samplers::Sampler& sampler,
                    film::SampleCounts& sample_counts, const Radiance& radiance) {
  const EyeRay sample = eye_ray(context, x, y, sampler);
  return radiance(sample.ray, sampler, sample_counts) * sample.weight;
}

// A radiance, and the part of it that belongs to film layer 1, too.
struct ValueWithPart {
  Spectrum value, part;
  ValueWithPart operator*(float weight) const { return {value * weight, part * weight}; }
};

inline Spectrum& value_of(Spectrum& value) {
  return value;
}
inline Spectrum& value_of(ValueWithPart& found) {
  return found.value;
}

// radiance(ray, sampler, sample_counts, letters[, iteration]), a Spectrum or a ValueWithPart: letters, of the
// path, are null where nobody asks for layers; iteration: of the job.
template <class Radiance>
Result<void> run_eye_samples(const UnitContext& context, const Unit& unit, film::UnitFilm& film,
                             const RunContext& run, const Radiance& radiance) {
  const bool signed_values = context.filter.has_negative_lobes();
  return for_each_tile(
      context.width, context.height, film, run,
      [&](std::uint32_t x0, std::uint32_t y0, std::uint32_t x1, std::uint32_t y1,
          film::SampleCounts& sample_counts) {
        samplers::Sampler sampler(context.sampler, context.seed);
        std::optional<transport::EyeLetters> letters;
        if (context.letters != nullptr) letters.emplace(*context.letters);
        for (std::uint32_t y = y0; y < y1; ++y) {
          for (std::uint32_t x = x0; x < x1; ++x) {
            for (std::uint64_t index = unit.begin; index < unit.end; ++index) {
              if (run.stopped()) return;
              sampler.start(unit.half, index, x, y);
              const std::uint64_t key = sampler.sample_key();
              const EyeRay sample = eye_ray(context, x, y, sampler);
              if (letters) letters->begin(key, sample.ray);
              auto found = [&] {
                transport::EyeLetters* const of_path = letters ? &*letters : nullptr;
                if constexpr (std::is_invocable_v<const Radiance&, const Ray&, samplers::Sampler&,
                                                  film::SampleCounts&, transport::EyeLetters*, std::uint64_t>)
                  return radiance(sample.ray, sampler, sample_counts, of_path,
                                  global_iteration(unit.half, index));
                else
                  return radiance(sample.ray, sampler, sample_counts, of_path);
              }() * sample.weight;
              constexpr bool kPart = std::is_same_v<decltype(found), ValueWithPart>;
              Spectrum& value = value_of(found);
              if (run.fault != nullptr) run.fault(key, &value.r);
              const bool kept =
                  film.add(0, x, y, {value.r, value.g, value.b}, key, sample_counts, signed_values);
              if constexpr (kPart) {
                const Spectrum& part = found.part;
                if (kept && !part.is_black())
                  film.add(1, x, y, {part.r, part.g, part.b}, key, sample_counts, signed_values);
              }
              if (letters && kept) letters->sums().gather(film, sample.weight, key);
            }
            if (letters) letters->sums().write_gathered(film, x, y);
            sample_counts.eye_samples += unit.end - unit.begin;
          }
        }
      });
}

template <class Radiance>
std::vector<float> pilot_eye_samples(const UnitContext& context, std::uint32_t count,
                                     const Radiance& radiance) {
  std::vector<float> luminances;
  luminances.reserve(count);
  film::SampleCounts sample_counts;
  samplers::Sampler sampler(samplers::SamplerKind::independent,
                            rng::key(context.seed, 0x70696c6f74ULL));  // "pilot"
  for (std::uint32_t i = 0; i < count; ++i) {
    work_step();
    // Pixels by a fixed random choice over the film.
    rng::Stream place(rng::key(context.seed, 0x706c616365ULL, i));  // "place"
    const auto x = static_cast<std::uint32_t>(place.next_double() * context.width);
    const auto y = static_cast<std::uint32_t>(place.next_double() * context.height);
    sampler.start(0, i, x, y);
    const float value = luminance(eye_sample(context, x, y, sampler, sample_counts, radiance));
    if (std::isfinite(value)) luminances.push_back(std::fabs(value));
  }
  return luminances;
}

}  // namespace candela::integrators
