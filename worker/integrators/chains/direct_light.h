// Light seen directly and after one bounce by ordinary path tracing, beside chains that leave it out
// (direct=path): a fixed number of eye samples with each segment of a chain.
//
// Pixels: in the order of PixelOrder, whose round is the sample's index in its pixel. The offset is random:
// each pixel has the same number of samples on average, whatever segments there are.
#pragma once

#include <cstdint>
#include <optional>

#include "worker/estimators/path_dispatch.h"
#include "worker/integrators/eye_samples.h"
#include "worker/integrators/path/plan.h"
#include "worker/integrators/pixel_order.h"

namespace candela::integrators::chain_jobs {

class DirectLight {
 public:
  // samples: of each segment.
  DirectLight(const UnitContext& context, const estimators::PathOptions& options, const Planned& planned,
              std::uint64_t samples, std::uint32_t half)
      : context_(context),
        options_(options),
        techniques_(planned.techniques),
        radiance_(estimators::path_radiance_in<samplers::Sampler>(context.scene, planned.between,
                                                                  context.letters != nullptr)),
        samples_(samples),
        order_(std::uint64_t{context.width} * context.height,
               rng::key(context.seed, 0x646972656374ULL, half)),  // "direct"
        half_(half) {}

  // Adds samples of sequence index `segment` of the half. False: stopped.
  bool add(std::uint64_t segment, std::uint32_t layer, film::UnitFilm& film,
           film::SampleCounts& sample_counts, const RunContext& run) const {
    const bool signed_values = context_.filter.has_negative_lobes();
    const float weight =
        static_cast<float>(static_cast<double>(order_.pixels()) / static_cast<double>(samples_));
    samplers::Sampler sampler(context_.sampler, context_.seed);
    std::optional<transport::EyeLetters> letters;
    if (context_.letters != nullptr) letters.emplace(*context_.letters);
    std::uint64_t at = order_.place(segment * samples_);
    for (std::uint64_t i = 0; i < samples_; ++i) {
      if (i % 64 == 0 && run.stopped()) return false;
      const auto x = static_cast<std::uint32_t>(at % context_.width);
      const auto y = static_cast<std::uint32_t>(at / context_.width);
      sampler.start(half_, order_.round(segment * samples_ + i), x, y);
      const EyeRay eye = eye_ray(context_, x, y, sampler);
      const std::uint64_t key = sampler.sample_key();
      if (letters) letters->begin(key, eye.ray);
      Spectrum value = radiance_(context_.scene, options_, techniques_, eye.ray, sampler, sample_counts,
                                 nullptr, letters ? &*letters : nullptr) *
                       eye.weight;
      value *= weight;
      if (run.fault != nullptr) run.fault(key, &value.r);
      const bool kept =
          film.splat(layer, x, y, {value.r, value.g, value.b}, key, sample_counts, signed_values);
      if (letters && kept) {
        letters->sums().scale(eye.weight);  // in two steps, as the image's value
        letters->sums().write(film, x, y, weight, key, layer * context_.letters->layer_count());
      }
      at = order_.next(at);
    }
    sample_counts.eye_samples += samples_;
    return true;
  }

 private:
  const UnitContext& context_;
  const estimators::PathOptions& options_;
  const estimators::Techniques& techniques_;
  estimators::RadianceFunction<samplers::Sampler> radiance_;
  std::uint64_t samples_;
  PixelOrder order_;
  std::uint32_t half_;
};

}  // namespace candela::integrators::chain_jobs
