// phi of the merges at one vertex: see none.h.
#pragma once

#include <numbers>

#include "worker/core/vec.h"
#include "worker/transport/vertex.h"

namespace candela::transport {

// 1 over the disc and over the ball of the first radius.
struct FirstExtents {
  explicit FirstExtents(double r)
      : per_disc(1 / (std::numbers::pi * r * r)), per_ball(0.75 / (std::numbers::pi * r * r * r)) {}
  double per_disc, per_ball;
};

class Phi {
 public:
  void start(const ScatterPoint& v, const FirstExtents& first, float per_path) {
    throughput_ = v.throughput;
    weights_ = v.throughput * Spectrum(0.212671f, 0.715160f, 0.072169f);  // luminance()
    scale_ = static_cast<double>(per_path) * (v.on_surface() ? first.per_disc : first.per_ball);
  }
  // phi is weight() times scale(), phi of each channel color() times scale().
  float weight(Spectrum value, float factor) const {
    return (weights_.r * value.r + weights_.g * value.g + weights_.b * value.b) * factor;
  }
  Spectrum color(Spectrum value, float factor) const { return throughput_ * value * factor; }
  double scale() const { return scale_; }

 private:
  Spectrum throughput_, weights_;
  double scale_ = 0;
};

}  // namespace candela::transport
