// The statistics of the chi-squared test: numbers of photons that add light, in twelve sectors.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>

#include "common/film/accumulator.h"
#include "worker/transport/statistics/phi.h"
#include "worker/transport/statistics/put.h"
#include "worker/transport/statistics/sectors.h"

namespace candela::transport {

// Accumulators: 12 counts.
class SectorCounts {
 public:
  static constexpr bool kCollects = true, kReaches = false;

  void begin() {
    if (!any_) return;
    counts_ = {};
    any_ = false;
  }
  void start(const ScatterPoint& v, const MergeScale& scale, float /*per_path*/) {
    throughput_ = v.throughput;
    sectors_.start(v, scale);
  }
  void add(Vec3 offset, Spectrum value, float factor, float /*kernel*/) {
    const float weight = luminance(throughput_ * value) * factor;
    if (weight > 0 && !photons_.add(offset, weight)) end();
  }
  void end() {
    Sectors::Channels channels;
    sectors_.find(photons_, channels);
    for (std::size_t i = 0; i < photons_.count; ++i) counts_[static_cast<std::size_t>(channels[i])] += 1;
    any_ |= photons_.count > 0;
    photons_.count = 0;
  }
  bool write(std::span<const std::unique_ptr<film::UnitAccumulator>> accumulators, std::uint32_t x,
             std::uint32_t y, float weight, std::uint64_t key, bool alone) const {
    if (!any_ || weight == 0) return true;
    return put_statistics(*accumulators[0], alone, x, y, counts_, key);
  }

  const std::array<double, Sectors::kCount>& counts() const { return counts_; }

 private:
  Sectors sectors_;
  PhotonBatch photons_;
  Spectrum throughput_;
  std::array<double, Sectors::kCount> counts_{};
  bool any_ = false;
};

}  // namespace candela::transport
