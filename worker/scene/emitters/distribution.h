// Choosing one of many by weight, in the order they are in: the inverse of the cumulative distribution, found
// in constant expected time by a guide table (Chen and Asau 1974).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

namespace candela::scene {

class Distribution {
 public:
  Distribution() = default;
  // Weights are finite and not negative. All zero: total() is 0 and sample() must not be called.
  explicit Distribution(const std::vector<double>& weights) {
    cumulative_.reserve(weights.size());
    for (const double w : weights) cumulative_.push_back(total_ += w);
    if (!(total_ > 0)) return;
    guide_.resize(weights.size());
    std::uint32_t at = 0;
    for (std::size_t i = 0; i < guide_.size(); ++i) {
      const double edge = total_ * static_cast<double>(i) / static_cast<double>(guide_.size());
      while (at + 1 < cumulative_.size() && cumulative_[at] <= edge) ++at;
      guide_[i] = at;
    }
  }

  double total() const { return total_; }
  std::size_t size() const { return cumulative_.size(); }
  double probability(std::uint32_t i) const {
    return (cumulative_[i] - (i > 0 ? cumulative_[i - 1] : 0.0)) / total_;
  }

  // The u that sample() takes to element i, where u falls at `rest` of it.
  double place(std::uint32_t i, double rest) const {
    const double low = i > 0 ? cumulative_[i - 1] : 0.0;
    return (low + rest * (cumulative_[i] - low)) / total_;
  }

  // u in [0, 1). Never an element of weight zero. `rest`: where in the element u fell, uniform in [0, 1)
  // again.
  std::uint32_t sample(double u, double* rest = nullptr) const {
    const auto cell = static_cast<std::size_t>(u * static_cast<double>(guide_.size()));
    std::uint32_t i = guide_[std::min(cell, guide_.size() - 1)];
    const double x = u * total_;
    while (i > 0 && x < cumulative_[i - 1]) --i;  // rounding of the cell
    while (i + 1 < cumulative_.size() && cumulative_[i] <= x) ++i;
    while (i > 0 && !(cumulative_[i] > cumulative_[i - 1])) --i;  // a tail of zero weights
    if (rest != nullptr) {
      const double low = i > 0 ? cumulative_[i - 1] : 0.0;
      *rest = std::clamp((x - low) / (cumulative_[i] - low), 0.0, 1.0 - 0x1p-53);
    }
    return i;
  }

 private:
  std::vector<double> cumulative_;
  std::vector<std::uint32_t> guide_;
  double total_ = 0;
};

// A choice among many needs more than the 24 bits of a draw, or elements of small weight would never be
// found. The bits that choose below 2^-24 are the lowest of the draws for the point on the element, where
// they move it by less than 2^-12 of its size.
inline double extend_draw(float u, float v, float w) {
  const auto low = [](float x) {
    const double scaled = static_cast<double>(x) * 4096.0;
    return scaled - std::floor(scaled);
  };
  const double fraction = (std::floor(low(v) * 4096.0) + low(w)) / 4096.0;
  return std::min(static_cast<double>(u) + fraction * 0x1p-24, 1.0 - 0x1p-53);
}

}  // namespace candela::scene
