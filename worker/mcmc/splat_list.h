// What one state of a chain adds to the image: colors at places on the film. Its scalar contribution, which
// the chain follows, is the sum of their luminances.
#pragma once

#include <cmath>
#include <optional>
#include <span>
#include <vector>

#include "common/film/counts.h"
#include "worker/core/vec.h"
#include "worker/transport/film_position.h"

namespace candela::mcmc {

struct Splat {
  transport::FilmPosition at;
  Spectrum value;
};

class SplatList {
 public:
  void clear() {
    splats_.clear();
    scalar_ = 0;
  }
  void add(transport::FilmPosition at, Spectrum value) {
    if (value.is_black()) return;
    splats_.push_back({at, value});
    scalar_ += static_cast<double>(luminance(value));
  }
  std::span<const Splat> splats() const { return splats_; }
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
  double scalar_ = 0;
};

}  // namespace candela::mcmc
