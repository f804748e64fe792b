// Contributions of one state of a chain to the image: colors at places on the film. Its scalar contribution,
// which the chain follows, is the sum of their luminances, each times its importance.
#pragma once

#include <algorithm>
#include <optional>
#include <span>
#include <vector>

#include "common/film/counts.h"
#include "worker/core/vec.h"
#include "worker/mcmc/image_importance.h"
#include "worker/transport/film_position.h"
#include "worker/transport/letters/layer_sums.h"

namespace candela::mcmc {

struct Splat {
  transport::FilmPosition at;
  Spectrum value;
};

class SplatList {
 public:
  SplatList() = default;
  // importance: null: 1 everywhere. It must outlive the list and its copies.
  explicit SplatList(const ImageImportance* importance) : importance_(importance) {}
  const ImageImportance* importance() const { return importance_; }

  void clear() {
    splats_.clear();
    parts_.clear();
    ends_.clear();
    scalar_ = 0;
    mollified_.clear();
    mollified_scalar_ = 0;
  }
  // False: a black value, which is left out.
  bool add(transport::FilmPosition at, Spectrum value) {
    if (value.is_black()) return false;
    splats_.push_back({at, value});
    scalar_ += weighted(splats_.back(), value);
    return true;
  }
  // The part of the splat that was added last that mollified paths have.
  void mollify(Spectrum part) {
    if (part.is_black()) return;
    mollified_.resize(splats_.size());
    mollified_.back() = part;
    mollified_scalar_ += weighted(splats_.back(), part);
  }
  // The labels of the splat that was added last: of one path; of an eye path's contributions, whose prefixes
  // are `sums` times `scale`.
  void label(const transport::ChannelLabels& labels) {
    const transport::LabelledSum whole{Spectrum(1.0f), labels};
    label(std::span(&whole, 1), splats_.back().value);
  }
  void label(std::span<const transport::LabelledSum> sums, const Spectrum& scale) {
    for (const transport::LabelledSum& part : sums) parts_.push_back({part.sum * scale, part.labels});
    ends_.resize(splats_.size(), ends_.empty() ? 0 : ends_.back());
    ends_.back() = static_cast<std::uint32_t>(parts_.size());
  }
  std::span<const Splat> splats() const { return splats_; }
  // Parts of splat i; none if the job has no expressions.
  std::span<const transport::LabelledSum> parts(std::size_t i) const {
    if (i >= ends_.size()) return {};
    const std::uint32_t begin = i == 0 ? 0 : ends_[i - 1];
    return std::span(parts_).subspan(begin, ends_[i] - begin);
  }
  double scalar() const { return scalar_; }
  // The part of splat i that is mollified; black if none is.
  Spectrum mollified(std::size_t i) const { return i < mollified_.size() ? mollified_[i] : Spectrum(); }
  // The mollified part of scalar(), at most the whole.
  double mollified_scalar() const { return std::min(mollified_scalar_, scalar_); }

  // Reason to reject the list, if there is one: the first cause found.
  std::optional<film::RejectCause> fault() const;
  // Film position of the brightest splat. Precondition: the list is not empty.
  transport::FilmPosition brightest() const;

  // For tests of the quarantine.
  std::span<Splat> editable() { return splats_; }
  void sum_again();

 private:
  // part: of the splat's value, or all of it.
  double weighted(const Splat& splat, const Spectrum& part) const {
    const auto light = static_cast<double>(luminance(part));
    return importance_ == nullptr
               ? light
               : light * importance_->at(splat.at, static_cast<double>(luminance(splat.value)));
  }

  const ImageImportance* importance_ = nullptr;
  std::vector<Splat> splats_;
  std::vector<transport::LabelledSum> parts_;
  std::vector<std::uint32_t> ends_;  // of each splat's parts
  std::vector<Spectrum> mollified_;  // of each splat up to the last one that has any
  double scalar_ = 0, mollified_scalar_ = 0;
};

}  // namespace candela::mcmc
