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

// Accumulators: 12 sums, the sum of squares.
class WeightedSectors {
 public:
  static constexpr bool kCollects = true, kReaches = false;

  explicit WeightedSectors(double first_radius) : first_(first_radius) {}

  void begin() {
    if (squares_ == 0) return;
    sums_ = {};
    squares_ = 0;
  }
  void start(const ScatterPoint& v, const MergeScale& scale, float per_path) {
    phi_.start(v, first_, per_path);
    sectors_.start(v, scale);
  }
  void add(Vec3 offset, Spectrum value, float factor, float /*kernel*/) {
    if (!photons_.add(offset, phi_.weight(value, factor))) end();
  }
  void end() {
    Sectors::Channels channels;
    sectors_.find(photons_, channels);
    for (std::size_t i = 0; i < photons_.count; ++i) {
      const double phi = static_cast<double>(photons_.weight[i]) * phi_.scale();
      sums_[static_cast<std::size_t>(channels[i])] += phi;
      squares_ += phi * phi;
    }
    photons_.count = 0;
  }
  // A path whose squares the accumulator cannot hold adds nothing. It would outweigh all others, and then no
  // test rejects. Sums fit where squares do: the largest is the root of that of squares times 2^24.
  bool write(std::span<const std::unique_ptr<film::UnitAccumulator>> accumulators, std::uint32_t x,
             std::uint32_t y, float weight, std::uint64_t key, bool alone) const {
    if (squares_ == 0) return true;
    const double scale = std::abs(static_cast<double>(weight));
    const double squares = squares_ * scale * scale;
    if (!put_statistics(*accumulators[1], alone, x, y, {&squares, 1}, key)) return false;
    std::array<double, Sectors::kCount> sums = sums_;
    for (double& sum : sums) sum *= scale;
    return put_statistics(*accumulators[0], alone, x, y, sums, key);
  }

  const std::array<double, Sectors::kCount>& sums() const { return sums_; }
  double squares() const { return squares_; }

 private:
  FirstExtents first_;
  Phi phi_;
  Sectors sectors_;
  PhotonBatch photons_;
  std::array<double, Sectors::kCount> sums_{};
  double squares_ = 0;
};

}  // namespace candela::transport
