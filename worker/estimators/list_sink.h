// The sink of Bidirectional that goes to a chain's list. The scalar contribution is that of the image's
// mean: values are divided by the number of pixels.
#pragma once

#include <type_traits>

#include "worker/estimators/bidirectional.h"
#include "worker/estimators/film_domain.h"
#include "worker/mcmc/splat_list.h"

namespace candela::estimators {

class ListSink {
 public:
  explicit ListSink(const FilmDomain& film)
      : per_light_(static_cast<float>(1 / film.pixels())),
        per_eye_(static_cast<float>(film.area_over_film())) {}

  // All goes to `out`, multiplied by `factor`.
  void start(mcmc::SplatList& out, float factor = 1) {
    out_ = &out;
    factor_ = factor;
    sum_ = {};
  }
  void eye(const transport::Contribution& light, std::uint32_t /*s*/, std::uint32_t /*t*/) {
    sum_ += light.weighted();
  }
  Spectrum sum() const { return sum_; }
  void light(const transport::Contribution& light, std::uint32_t /*s*/, std::uint32_t /*t*/,
             transport::FilmPosition at, std::uint64_t /*key*/, const transport::PathLetters* /*letters*/,
             const transport::ChannelLabels* labels) {
    const Spectrum value = light.weighted() * (per_light_ * factor_);
    if (out_->add(at, value) && labels != nullptr) out_->label(*labels);
  }
  // Adds the light along the eye's ray, at this film position. weight: of the sensor. sums: the light's parts
  // by labels; null if the job has no expressions.
  void finish_eye(transport::FilmPosition at, float weight, const transport::LayerSums* sums) {
    const float scale = per_eye_ * factor_ * weight;
    if (out_->add(at, sum_ * scale) && sums != nullptr) out_->label(sums->sums(), Spectrum(scale));
  }

 protected:
  float per_light_, per_eye_;
  mcmc::SplatList* out_ = nullptr;
  float factor_ = 1;
  Spectrum sum_;
};

// For a configuration that mollifies: the list knows what mollified paths brought.
class MollifyingListSink : public ListSink {
 public:
  using ListSink::ListSink;

  void start(mcmc::SplatList& out, float factor = 1) {
    ListSink::start(out, factor);
    mollified_ = {};
  }
  void mollified_eye(const transport::Contribution& found, std::uint32_t s, std::uint32_t t) {
    eye(found, s, t);
    mollified_ += found.weighted();
  }
  void mollified_light(const transport::Contribution& found, std::uint32_t /*s*/, std::uint32_t /*t*/,
                       transport::FilmPosition at, std::uint64_t /*key*/) {
    const Spectrum value = found.weighted() * (per_light_ * factor_);
    if (out_->add(at, value)) out_->mollify(value);
  }
  void finish_eye(transport::FilmPosition at, float weight, const transport::LayerSums* /*sums*/) {
    const float scale = per_eye_ * factor_ * weight;
    if (out_->add(at, sum_ * scale)) out_->mollify(mollified_ * scale);
  }

 private:
  Spectrum mollified_;  // along the eye's ray
};

// Bidirectional for chains. ChoiceT: see there.
template <transport::EdgeContent kB, class ChoiceT, bool kM = false, bool kE = false>
struct ListConfig {
  static constexpr bool kEdits = kE;
  static constexpr transport::EdgeContent kEdgeContent = kB;
  static constexpr bool kLists = false;
  static constexpr bool kMollifies = kM;
  using Mis = transport::Balance;
  using Sampler = mcmc::PrimarySampler;
  using Sink = std::conditional_t<kM, MollifyingListSink, ListSink>;
  using Choice = ChoiceT;
};

}  // namespace candela::estimators
