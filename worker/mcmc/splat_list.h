// What one state of a chain adds to the image: colors at places on the film. Its scalar contribution, which
// the chain follows, is the sum of their luminances.
#pragma once

#include <cmath>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "common/film/counts.h"
#include "worker/core/vec.h"
#include "worker/transport/film_position.h"
#include "worker/transport/letters/layer_sums.h"

namespace candela::mcmc {

struct Splat {
  transport::FilmPosition at;
  Spectrum value;
  std::uint32_t parts = 0;  // of SplatList::parts(), those that the splat has there
};

class SplatList {
 public:
  void clear() {
    splats_.clear();
    parts_.clear();
    scalar_ = 0;
  }
  void add(transport::FilmPosition at, Spectrum value) {
    added_ = false;
    if (value.is_black()) return;
    splats_.push_back({at, value});
    scalar_ += static_cast<double>(luminance(value));
    added_ = true;
  }
  // The labels of what was added last (a black value has none): of one path; of an eye path's contributions,
  // whose prefixes are `sums` times `scale`.
  void label(const transport::ChannelLabels& labels) {
    if (!std::exchange(added_, false)) return;
    parts_.push_back({splats_.back().value, labels});
    splats_.back().parts = 1;
  }
  void label(std::span<const transport::LabelledSum> sums, float scale) {
    if (!std::exchange(added_, false)) return;
    for (const transport::LabelledSum& part : sums) parts_.push_back({part.sum * scale, part.labels});
    splats_.back().parts = static_cast<std::uint32_t>(sums.size());
  }
  std::span<const Splat> splats() const { return splats_; }
  // Those of the first splat, then those of the next; none where nobody asks for layers.
  std::span<const transport::LabelledSum> parts() const { return parts_; }
  double scalar() const { return scalar_; }

  // Reason to reject the list, if there is one: the first cause found.
  std::optional<film::RejectCause> fault() const;
  // Film position of the brightest splat. Precondition: the list is not empty.
  transport::FilmPosition brightest() const;

  // For tests of the quarantine.
  std::span<Splat> editable() { return splats_; }
  void sum_again();

 private:
  std::vector<Splat> splats_;
  std::vector<transport::LabelledSum> parts_;
  bool added_ = false;  // a splat, by the last add()
  double scalar_ = 0;
};

}  // namespace candela::mcmc
