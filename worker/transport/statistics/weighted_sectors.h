// The statistics of the F test: sums of phi in twelve sectors, and the sum of squares
// [Lin 2023, Eq. 7], of which one sum of squares is enough.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <span>

#include "common/film/accumulator.h"
#include "worker/transport/statistics/phi.h"
#include "worker/transport/statistics/put.h"
#include "worker/transport/statistics/sectors.h"

namespace candela::transport {

// Accumulators, for luminance or for each of three channels: 12 sums, the sum of squares.
class WeightedSectors {
 public:
  static constexpr bool kCollects = true, kReaches = false;
  static constexpr std::size_t kColors = adaptive::kColors;

  // colors: statistics of red, green and blue in place of luminance.
  explicit WeightedSectors(double first_radius, bool colors = false)
      : first_(first_radius), count_(colors ? kColors : 1) {}

  void begin() {
    if (!any_) return;
    sums_ = {};
    squares_ = {};
    any_ = false;
  }
  void start(const ScatterPoint& v, const MergeScale& scale, float per_path) {
    phi_.start(v, first_, per_path);
    sectors_.start(v, scale);
  }
  void add(Vec3 offset, Spectrum value, float factor, float /*kernel*/) {
    bool room = false;
    if (count_ == 1) {
      room = photons_.add(offset, phi_.weight(value, factor));
    } else {
      const Spectrum color = phi_.color(value, factor);
      green_[photons_.count] = color.g;
      blue_[photons_.count] = color.b;
      room = photons_.add(offset, color.r);
    }
    if (!room) end();
  }
  void end() {
    if (photons_.count == 0) return;
    Sectors::Channels channels;
    sectors_.find(photons_, channels);
    collect(channels, photons_.weight, 0);
    if (count_ > 1) {
      collect(channels, green_, 1);
      collect(channels, blue_, 2);
    }
    any_ = true;
    photons_.count = 0;
  }
  // A path whose squares the accumulator cannot hold adds nothing. It would outweigh all others, and then no
  // test rejects. Sums fit where squares do: the largest is the root of that of squares times 2^24.
  bool write(std::span<const std::unique_ptr<film::UnitAccumulator>> accumulators, std::uint32_t x,
             std::uint32_t y, float weight, std::uint64_t key, bool alone) const {
    if (!any_) return true;
    const double scale = std::abs(static_cast<double>(weight));
    auto squares = squares_;
    for (double& square : squares) square *= scale * scale;
    if (!put_statistics(*accumulators[1], alone, x, y, std::span(squares).first(count_), key)) return false;
    auto sums = sums_;
    for (double& sum : sums) sum *= scale;
    return put_statistics(*accumulators[0], alone, x, y, std::span(sums).first(count_ * Sectors::kCount),
                          key);
  }

  // Sums of each color in turn.
  std::span<const double> sums() const { return std::span(sums_).first(count_ * Sectors::kCount); }
  std::span<const double> squares() const { return std::span(squares_).first(count_); }

 private:
  void collect(const Sectors::Channels& channels, const float* weights, std::size_t color) {
    double* const sums = sums_.data() + color * Sectors::kCount;
    double squares = squares_[color];
    for (std::size_t i = 0; i < photons_.count; ++i) {
      const double phi = static_cast<double>(weights[i]) * phi_.scale();
      sums[channels[i]] += phi;
      squares += phi * phi;
    }
    squares_[color] = squares;
  }

  FirstExtents first_;
  std::size_t count_;  // of colors
  Phi phi_;
  Sectors sectors_;
  PhotonBatch photons_;  // weights: luminance, or red
  float green_[PhotonBatch::kMax], blue_[PhotonBatch::kMax];
  bool any_ = false;
  std::array<double, kColors * Sectors::kCount> sums_{};
  std::array<double, kColors> squares_{};
};

}  // namespace candela::transport
