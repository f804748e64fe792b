// The tables of a rough coat whose roughness varies over the surface.
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "worker/scene/bsdfs/rough_transmittance.h"

namespace candela::scene {

// The coat of one roughness: a table, or a mix of the two whose roughnesses are next to it.
struct CoatAt {
  const RoughTransmittance* low = nullptr;
  const RoughTransmittance* high = nullptr;  // null: low alone
  float share = 0;                           // of high

  float transmittance(float mu) const {
    const float t = low->transmittance(mu);
    return high == nullptr ? t : t + share * (high->transmittance(mu) - t);
  }
  double internal_reflectance() const {
    const double r = low->internal_reflectance();
    return high == nullptr ? r : r + static_cast<double>(share) * (high->internal_reflectance() - r);
  }
  double internal_return() const {
    const double r = low->internal_return();
    return high == nullptr ? r : r + static_cast<double>(share) * (high->internal_return() - r);
  }
};

class CoatTables {
 public:
  // `make(alpha)` gives the table of a roughness. One table if least is most; else tables at multiples of
  // 1/32, which bsdfs share, up to 4, beyond which they change little. The transmittance between two is off
  // by less than 2e-3.
  template <class Make>
  static CoatTables between(float least, float most, const Make& make) {
    CoatTables result;
    if (!(least < most)) {
      result.tables_.push_back(make(least));
      return result;
    }
    const auto first = static_cast<int>(std::floor(std::min(least, kLargest) * kPerAlpha));
    const auto last = static_cast<int>(std::ceil(std::min(most, kLargest) * kPerAlpha));
    result.first_ = static_cast<float>(first);
    for (int i = first; i <= std::max(last, first + 1); ++i)
      result.tables_.push_back(make(static_cast<float>(i) / kPerAlpha));
    return result;
  }

  // For a roughness outside of [least, most]: the nearest.
  CoatAt at(float alpha) const {
    if (tables_.size() == 1) return {tables_[0].get(), nullptr, 0};
    const auto last = static_cast<float>(tables_.size() - 1);
    const float x = std::clamp(alpha * kPerAlpha - first_, 0.0f, last);
    const std::size_t n = std::min(static_cast<std::size_t>(x), tables_.size() - 2);
    return {tables_[n].get(), tables_[n + 1].get(), x - static_cast<float>(n)};
  }

 private:
  static constexpr float kPerAlpha = 32, kLargest = 4;
  std::vector<std::shared_ptr<const RoughTransmittance>> tables_;
  float first_ = 0;  // the first table's alpha times kPerAlpha
};

}  // namespace candela::scene
