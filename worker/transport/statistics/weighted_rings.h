// The statistics of tests that outlive a radius (common/adaptive/rings.h): sums of phi and of phi^2 in rings
// around an eye's vertex, whose borders follow from the first radius alone.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <span>

#include "common/adaptive/channels.h"
#include "common/film/accumulator.h"
#include "worker/transport/merge_scale.h"
#include "worker/transport/statistics/phi.h"
#include "worker/transport/statistics/put.h"
#include "worker/transport/vertex.h"

namespace candela::transport {

// Accumulators: a sum for each ring (kPerRing = 1) or for its six sectors (kPerRing = 6), the sum of squares
// of each ring. phi of media is weighted so that rings of balls have the shares of rings of discs.
template <int kPerRing>
class WeightedRings {
 public:
  static constexpr bool kCollects = true, kReaches = false;
  static constexpr std::size_t kRings = adaptive::kRings;

  explicit WeightedRings(double first_radius) : first_(first_radius), r2_(first_radius * first_radius) {}

  void begin() {
    if (!any_) return;
    sums_ = {};
    squares_ = {};
    any_ = false;
  }
  void start(const ScatterPoint& v, const MergeScale& scale, float per_path) {
    phi_.start(v, first_, per_path);
    surface_ = v.on_surface();
    if (surface_) frame_ = make_frame(v.hit.ng);
    // The level of the present radius, which is 2^(-level/2) of the first but for rounding.
    const auto radius = static_cast<double>(surface_ ? scale.disc_radius : scale.ball_radius);
    level_ = 0;
    for (double border = r2_ * 0.70710678118654752; radius * radius < border && level_ < adaptive::kRings - 1;
         border /= 2)
      ++level_;
  }
  void add(Vec3 offset, Spectrum value, float factor, float /*kernel*/) {
    double phi = static_cast<double>(phi_.weight(value, factor)) * phi_.scale();
    double distance_squared = 0;
    int sector = 0;
    if (surface_) {
      const auto u = static_cast<double>(dot(offset, frame_.s)),
                 v = static_cast<double>(dot(offset, frame_.t));
      distance_squared = u * u + v * v;
      if (kPerRing > 1) sector = adaptive::disc_sector(u, v);
    } else {
      distance_squared = static_cast<double>(dot(offset, offset));
      if (kPerRing > 1)
        sector = adaptive::ball_channel(static_cast<double>(offset.x), static_cast<double>(offset.y),
                                        static_cast<double>(offset.z), 1) %
                 adaptive::kSectorsPerRing;
    }
    const int ring = adaptive::ring_of(distance_squared, r2_, level_);
    if (!surface_) phi *= adaptive::ball_ring_weight(ring);
    sums_[static_cast<std::size_t>(ring * kPerRing + sector)] += phi;
    squares_[static_cast<std::size_t>(ring)] += phi * phi;
    any_ = true;
  }
  void end() {}
  // As WeightedSectors: a path whose squares the accumulator cannot hold adds nothing.
  bool write(std::span<const std::unique_ptr<film::UnitAccumulator>> accumulators, std::uint32_t x,
             std::uint32_t y, float weight, std::uint64_t key, bool alone) const {
    if (!any_ || weight == 0) return true;
    const double scale = std::abs(static_cast<double>(weight));
    auto squares = squares_;
    for (double& square : squares) square *= scale * scale;
    if (!put_statistics(*accumulators[1], alone, x, y, squares, key)) return false;
    auto sums = sums_;
    for (double& sum : sums) sum *= scale;
    return put_statistics(*accumulators[0], alone, x, y, sums, key);
  }

  const std::array<double, kRings * kPerRing>& sums() const { return sums_; }
  const std::array<double, kRings>& squares() const { return squares_; }

 private:
  FirstExtents first_;
  double r2_;
  Phi phi_;
  bool surface_ = true, any_ = false;
  Frame frame_;
  int level_ = 0;
  std::array<double, kRings * kPerRing> sums_{};
  std::array<double, kRings> squares_{};
};

}  // namespace candela::transport
