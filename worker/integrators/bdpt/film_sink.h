// Sink of the contributions of bdpt for the film: the sum along one eye ray, splats of light paths, and the
// layers of techniques.
#pragma once

#include <cstdint>

#include "worker/integrators/bdpt/layers.h"
#include "worker/integrators/integrator.h"
#include "worker/transport/splat.h"
#include "worker/transport/technique/contribution.h"

namespace candela::integrators::bdpt {

class FilmSink {
 public:
  FilmSink(const UnitContext& context, const TechniqueLayers& layers, double light_paths,
           film::UnitFilm& film, film::SampleCounts& sample_counts)
      : layers_(layers),
        film_(film),
        sample_counts_(sample_counts),
        splatter_(context.filter, film, context.width, context.height),
        each_(static_cast<float>(1 / light_paths)) {}

  // An eye ray through pixel (x, y) of this weight is next.
  void start_eye(std::uint32_t x, std::uint32_t y, float weight, std::uint64_t key) {
    sum_ = {};
    x_ = x;
    y_ = y;
    scale_ = weight;
    key_ = key;
  }
  // The radiance along it.
  Spectrum sum() const { return sum_; }

  void eye(const transport::Contribution& light, std::uint32_t s, std::uint32_t t) {
    const Spectrum weighted = light.weighted();
    sum_ += weighted;
    if (!layers_.any()) return;
    const std::uint64_t technique = (std::uint64_t{s} << 32) | t;
    add(layers_.weighted(s, t), weighted, technique);
    add(layers_.unweighted(s, t), light.value, technique);
  }

  void light(const transport::Contribution& light, std::uint32_t s, std::uint32_t t,
             transport::FilmPosition at, std::uint64_t key, const transport::PathLetters* letters,
             const transport::ChannelLabels* labels) {
    const Spectrum weighted = light.weighted() * each_;
    if (labels != nullptr)
      splatter_.splat_labelled(*letters, *labels, at, weighted, key, sample_counts_);
    else
      splatter_.splat(0, at, weighted, key, sample_counts_);
    if (!layers_.any()) return;
    if (const std::uint32_t layer = layers_.weighted(s, t); layer != TechniqueLayers::kNoLayer)
      splatter_.splat(layer, at, weighted, key, sample_counts_);
    if (const std::uint32_t layer = layers_.unweighted(s, t); layer != TechniqueLayers::kNoLayer)
      splatter_.splat(layer, at, light.value * each_, key, sample_counts_);
  }

 protected:
  // To the layer of mollified paths, if the job has one; from the eye, and splats.
  void add_mollified(const transport::Contribution& light, std::uint32_t s, std::uint32_t t) {
    add(layers_.mollified(), light.weighted(), (std::uint64_t{s} << 32) | t);
  }
  void splat_mollified(const transport::Contribution& light, transport::FilmPosition at, std::uint64_t key) {
    if (const std::uint32_t layer = layers_.mollified(); layer != TechniqueLayers::kNoLayer)
      splatter_.splat(layer, at, light.weighted() * each_, key, sample_counts_);
  }

 private:
  // A pixel's own sample, but other threads splat on the same pixels.
  void add(std::uint32_t layer, Spectrum value, std::uint64_t word) {
    if (layer == TechniqueLayers::kNoLayer) return;
    value *= scale_;
    film_.splat(layer, x_, y_, {value.r, value.g, value.b}, rng::combine(key_, word), sample_counts_, true);
  }

  const TechniqueLayers& layers_;
  film::UnitFilm& film_;
  film::SampleCounts& sample_counts_;
  transport::Splatter splatter_;
  float each_;

  // The eye path under way.
  Spectrum sum_;
  std::uint32_t x_ = 0, y_ = 0;
  float scale_ = 1;
  std::uint64_t key_ = 0;
};

}  // namespace candela::integrators::bdpt
