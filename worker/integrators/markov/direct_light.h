// Light seen directly and after one bounce by ordinary path tracing, beside chains that leave it out
// (direct=path): a fixed number of eye samples with each segment of a chain.
//
// Pixels: sample j of a half belongs to pixel (offset + j * stride) mod pixels, round j / pixels being the
// sample's index there. The stride is coprime to the number of pixels, so that each round has each pixel
// once, and near the golden section of it, so that any part of a round is spread evenly. The offset is
// random: each pixel has the same number of samples on average, whatever segments there are.
#pragma once

#include <cstdint>
#include <numeric>

#include "worker/estimators/path_dispatch.h"
#include "worker/integrators/eye_samples.h"
#include "worker/integrators/path/plan.h"

namespace candela::integrators::markov {

class DirectLight {
 public:
  // samples: of each segment.
  DirectLight(const UnitContext& context, const estimators::PathOptions& options, const Planned& planned,
              std::uint64_t samples, std::uint32_t half)
      : context_(context),
        options_(options),
        techniques_(planned.techniques),
        radiance_(estimators::path_radiance_for<samplers::Sampler>(planned.between)),
        samples_(samples),
        pixels_(std::uint64_t{context.width} * context.height),
        half_(half) {
    stride_ = static_cast<std::uint64_t>(0.6180339887498949 * static_cast<double>(pixels_)) | 1;
    while (std::gcd(stride_, pixels_) != 1) ++stride_;
    offset_ = rng::key(context.seed, 0x646972656374ULL, half) % pixels_;  // "direct"
  }

  // Of sequence index `segment` of the half. False: stopped.
  bool add(std::uint64_t segment, std::uint32_t layer, film::UnitFilm& film, film::Tallies& tallies,
           const RunContext& run) const {
    const bool signed_values = context_.filter.has_negative_lobes();
    const float weight = static_cast<float>(static_cast<double>(pixels_) / static_cast<double>(samples_));
    samplers::Sampler sampler(context_.sampler, context_.seed);
    std::uint64_t at = place(segment * samples_);
    for (std::uint64_t i = 0; i < samples_; ++i) {
      if (i % 64 == 0 && run.stop != nullptr && run.stop->load(std::memory_order_relaxed)) return false;
      const auto x = static_cast<std::uint32_t>(at % context_.width);
      const auto y = static_cast<std::uint32_t>(at / context_.width);
      sampler.start(half_, (segment * samples_ + i) / pixels_, x, y);
      Spectrum value =
          eye_sample(context_, x, y, sampler, tallies,
                     [&](const Ray& ray, samplers::Sampler& draws, film::Tallies& counts) {
                       return radiance_(context_.scene, options_, techniques_, ray, draws, counts);
                     });
      value *= weight;
      if (run.fault != nullptr) run.fault(sampler.sample_key(), &value.r);
      film.splat(layer, x, y, {value.r, value.g, value.b}, sampler.sample_key(), tallies, signed_values);
      at += stride_;
      if (at >= pixels_) at -= pixels_;
    }
    tallies.eye_samples += samples_;
    return true;
  }

 private:
  // The pixel of sample j.
  std::uint64_t place(std::uint64_t j) const { return (offset_ + j % pixels_ * stride_) % pixels_; }

  const UnitContext& context_;
  const estimators::PathOptions& options_;
  const estimators::Techniques& techniques_;
  estimators::RadianceFunction<samplers::Sampler> radiance_;
  std::uint64_t samples_, pixels_, stride_ = 1, offset_ = 0;
  std::uint32_t half_;
};

}  // namespace candela::integrators::markov
