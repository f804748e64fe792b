// The statistics of the plug-in bandwidth [Kaplanyan 2017, Eq. 5.16-5.17]: the second moment of what merges
// add, and the Laplacian of the light around the vertex, by a stencil of kernels at distance h.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <span>

#include "common/film/accumulator.h"
#include "worker/transport/kernels.h"
#include "worker/transport/merge_scale.h"
#include "worker/transport/statistics/phi.h"

namespace candela::transport {

// Accumulators, without a unit but the film's:
//   moments    sum of k_r(y) phi^2 / k_1,    k_1 = 1 over the area (volume) of the first radius r_1
//   laplacian  sum of D_h(y) phi r_1^2 / k_1,
//   D_h(y) = h^-2 (sum over the axes a of [k_h(y - h a) + k_h(y + h a) - 2 k_h(y)])
class PlugInMoments {
 public:
  static constexpr bool kCollects = true, kReaches = true;

  // pilot: h, of the epoch.
  PlugInMoments(Kernel kernel, double first_radius, double pilot)
      : first_(first_radius),
        r2_over_h2_(first_radius * first_radius / (pilot * pilot)),
        h_(static_cast<float>(pilot)),
        disc_(kernel, h_),
        ball_(kernel, h_) {}

  float reach(bool /*surface*/) const { return 2 * h_; }
  void begin() { moment_ = laplacian_ = 0; }
  void start(const ScatterPoint& v, const MergeScale& /*scale*/, float per_path) {
    phi_.start(v, first_, per_path);
    surface_ = v.on_surface();
    if (surface_) frame_ = make_frame(v.hit.ng);
  }
  void add(Vec3 offset, Spectrum value, float factor, float kernel) {
    const double phi = static_cast<double>(phi_.weight(value, factor)) * phi_.scale();
    moment_ += static_cast<double>(kernel) / (surface_ ? first_.per_disc : first_.per_ball) * phi * phi;
    const double stencil = surface_ ? on_disc(offset) : in_ball(offset);
    laplacian_ += stencil * phi;
  }
  void end() {}
  void write(std::span<const std::unique_ptr<film::UnitAccumulator>> accumulators, std::uint32_t x,
             std::uint32_t y, float weight, std::uint64_t key) const {
    if (moment_ == 0 && laplacian_ == 0) return;
    const double scale = std::abs(static_cast<double>(weight));
    const double moment = moment_ * scale * scale, laplacian = laplacian_ * scale;
    film::Tallies ignored;
    if (accumulators[0]->splat(x, y, 0, {&moment, 1}, key, ignored))
      accumulators[1]->splat(x, y, 0, {&laplacian, 1}, key, ignored);
  }

  double moment() const { return moment_; }
  double laplacian() const { return laplacian_; }

 private:
  // D_h r_1^2 / k_1.
  double on_disc(Vec3 offset) const {
    const float u = dot(offset, frame_.s), v = dot(offset, frame_.t);
    const auto at = [&](float du, float dv) {
      const float d2 = (u - du) * (u - du) + (v - dv) * (v - dv);
      return d2 <= h_ * h_ ? static_cast<double>(disc_.value(d2)) : 0.0;
    };
    const double sum = at(h_, 0) + at(-h_, 0) + at(0, h_) + at(0, -h_) - 4 * at(0, 0);
    return sum * r2_over_h2_ / first_.per_disc;
  }
  double in_ball(Vec3 offset) const {
    const auto at = [&](Vec3 to) {
      const Vec3 y = offset - to;
      const float d2 = dot(y, y);
      return d2 <= h_ * h_ ? static_cast<double>(ball_.value(d2)) : 0.0;
    };
    const double sum = at({h_, 0, 0}) + at({-h_, 0, 0}) + at({0, h_, 0}) + at({0, -h_, 0}) + at({0, 0, h_}) +
                       at({0, 0, -h_}) - 6 * at({0, 0, 0});
    return sum * r2_over_h2_ / first_.per_ball;
  }

  FirstExtents first_;
  double r2_over_h2_;
  float h_;
  DiscKernel disc_;
  BallKernel ball_;
  Phi phi_;
  bool surface_ = true;
  Frame frame_;
  double moment_ = 0, laplacian_ = 0;
};

}  // namespace candela::transport
