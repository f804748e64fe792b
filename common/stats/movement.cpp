#include "common/stats/movement.h"

#include <cmath>
#include <utility>

namespace candela::stats {

// By the integral of its midpoints.
double mean_movement_weight(double from, double to, double alpha) {
  return (std::pow(to + 0.5, alpha) - std::pow(from + 0.5, alpha)) / (alpha * (to - from));
}

Movement Movement::of(BlockMeans last, std::array<Half, 2> sums) {
  Movement out;
  out.last_ = std::move(last);
  out.half_ = std::move(sums);
  return out;
}

bool Movement::due(double n0, double n1) const {
  return n0 >= 1 && n1 >= 1 && n0 >= 2 * last_.n0 && n1 >= 2 * last_.n1;
}

bool Movement::fits(const BlockMeans& now) const {
  return now.side == last_.side && now.width == last_.width && now.height == last_.height;
}

void Movement::extend(Half& half, double from, double to, double x, const std::vector<float>& before,
                      const std::vector<float>& now) {
  half.squares.resize(now.size(), 0.0F);
  half.cubes.resize(now.size(), 0.0F);
  double power = to - from;
  for (double& sum : half.powers) sum += power *= x;
  for (std::size_t i = 0; i < now.size(); ++i) {
    const double sum = double{now[i]} * to - (from > 0 ? double{before[i]} * from : 0);
    half.squares[i] += static_cast<float>(x * x * sum);
    half.cubes[i] += static_cast<float>(x * x * x * sum);
  }
}

void Movement::add(const BlockMeans& now, double alpha) {
  if (last_.n0 > 0 && !fits(now)) *this = {};
  if (!due(now.n0, now.n1)) return;
  const double x = mean_movement_weight(last_.n0 + last_.n1, now.n0 + now.n1, alpha);
  extend(half_[0], last_.n0, now.n0, x, last_.a, now.a);
  extend(half_[1], last_.n1, now.n1, x, last_.b, now.b);
  last_ = now;
}

Movement::Bias Movement::bias(const BlockMeans& now, double alpha) const {
  if (!(last_.n0 > 0) || !fits(now) || now.n0 < last_.n0 || now.n1 < last_.n1) return {};
  Bias bias;
  for (std::size_t h = 0; h < 2; ++h) {
    const double from = h == 0 ? last_.n0 : last_.n1, to = h == 0 ? now.n0 : now.n1;
    const std::vector<float>& image = h == 0 ? now.a : now.b;
    Half half = half_[h];
    if (to > from)
      extend(half, from, to, mean_movement_weight(last_.n0 + last_.n1, now.n0 + now.n1, alpha),
             h == 0 ? last_.a : last_.b, image);
    // slope = cov / var of the weighted iterations; the image's bias is the slope times the mean of x.
    const auto& [x1, x2, x3, x4] = half.powers;
    const double mean = x3 / x2, variance = x4 - x3 * mean;
    if (!(variance > 1e-4 * x3 * mean)) return {};
    std::vector<float>& out = h == 0 ? bias.a : bias.b;
    out.reserve(half.cubes.size());
    for (std::size_t i = 0; i < half.cubes.size(); ++i)
      out.push_back(static_cast<float>((half.cubes[i] - mean * half.squares[i]) / variance * (x1 / to)));
  }
  return bias;
}

}  // namespace candela::stats
