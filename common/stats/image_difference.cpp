#include "common/stats/image_difference.h"

#include <algorithm>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <limits>

namespace candela::stats {
namespace {

double finite_or_zero(std::span<const float> values, std::size_t i) {
  return values.empty() || !std::isfinite(values[i]) ? 0 : std::max(0.0, double{values[i]});
}

// p of a sum of differences with this variance, which is estimated from terms of one degree of freedom each.
double two_sided_p(double sum, double variance, double squared_variances) {
  if (std::isnan(sum)) return 0;
  if (sum == 0) return 1;
  if (!(variance > 0)) return 0;
  // The estimate of a normal value's variance s has variance 2 s^2, and its square the mean 3 s^2.
  const double freedom = std::max(1.0, 3 * variance * variance / squared_variances);
  const double t = std::fabs(sum) / std::sqrt(variance);
  if (!std::isfinite(t)) return 0;
  return 2 * boost::math::cdf(boost::math::complement(boost::math::students_t(freedom), t));
}

}  // namespace

ImageDifference difference(std::span<const float> a, std::span<const float> variance_a,
                           std::span<const float> b, std::span<const float> variance_b, std::uint32_t width,
                           std::uint32_t height, double p_limit) {
  ImageDifference result;
  const std::size_t pixels = std::size_t{width} * height;
  if (pixels == 0) return result;
  const auto count = static_cast<double>(pixels * film::kChannels);
  const ImageComparison figures = compare(a, b, width, height, 0);
  double finite_sum = 0;
  std::size_t finite = 0;
  for (const float value : b)
    if (std::isfinite(value)) {
      finite_sum += value;
      ++finite;
    }
  const double mean = finite == 0 ? 0 : finite_sum / static_cast<double>(finite);

  double sum_a = 0, sum_b = 0, squares = 0, relative = 0, expected = 0;  // variances of the sums
  for (std::size_t p = 0; p < pixels; ++p) {
    double deviation_a = 0, deviation_b = 0, square = 0, term = 0;
    for (std::size_t i = p * film::kChannels; i < (p + 1) * film::kChannels; ++i) {
      const double va = finite_or_zero(variance_a, i), vb = finite_or_zero(variance_b, i), v = va + vb;
      deviation_a += std::sqrt(va);
      deviation_b += std::sqrt(vb);
      const double d = double{a[i]} - double{b[i]};
      if (!std::isfinite(d)) continue;
      // The square of a normal difference of mean m and variance s has variance 2 s^2 + 4 s m^2; of the
      // estimates E v d^2 = s^2 + s m^2 and E v^2 = 3 s^2.
      const double of_square = std::sqrt(std::max(0.0, 4 * v * d * d - 2.0 / 3 * v * v));
      square += of_square;
      const double weight = relative_weight(b[i], mean);
      term += of_square * weight;
      expected += v * weight;
    }
    sum_a += deviation_a * deviation_a;
    sum_b += deviation_b * deviation_b;
    squares += square * square;
    relative += term * term;
  }
  ComparisonNoise& n = result.noise;
  n.mean_a = std::sqrt(sum_a) / count;
  n.mean_b = std::sqrt(sum_b) / count;
  n.mean_ratio = figures.mean_b == 0
                     ? std::numeric_limits<double>::quiet_NaN()
                     : std::hypot(n.mean_a, figures.mean_ratio * n.mean_b) / std::fabs(figures.mean_b);
  n.rmse = figures.rmse > 0 ? std::sqrt(squares) / count / (2 * figures.rmse) : 0;
  n.relmse = std::sqrt(relative) / count;
  n.expected_relmse = expected / count;

  std::vector<BlockDifference> blocks;
  for (std::uint32_t y0 = 0; y0 < height; y0 += kDifferenceBlock)
    for (std::uint32_t x0 = 0; x0 < width; x0 += kDifferenceBlock) {
      BlockDifference block;
      block.x = x0;
      block.y = y0;
      block.width = std::min(kDifferenceBlock, width - x0);
      block.height = std::min(kDifferenceBlock, height - y0);
      block.p = 1;
      for (std::size_t c = 0; c < film::kChannels; ++c) {
        double total_a = 0, total_b = 0, variance = 0, squared = 0;
        for (std::uint32_t y = y0; y < y0 + block.height; ++y)
          for (std::uint32_t x = x0; x < x0 + block.width; ++x) {
            const std::size_t i = (std::size_t{y} * width + x) * film::kChannels + c;
            const double v = finite_or_zero(variance_a, i) + finite_or_zero(variance_b, i);
            total_a += a[i];
            total_b += b[i];
            variance += v;
            squared += v * v;
          }
        const double number = static_cast<double>(block.width) * block.height;
        block.a[c] = total_a / number;
        block.b[c] = total_b / number;
        block.p = std::min(block.p, two_sided_p(total_a - total_b, variance, squared));
      }
      blocks.push_back(block);
    }
  result.blocks = static_cast<std::uint32_t>(blocks.size());
  for (BlockDifference& block : blocks) {
    block.p = std::min(1.0, block.p * film::kChannels * static_cast<double>(blocks.size()));
    if (block.p < p_limit) result.differing.push_back(block);
  }
  std::stable_sort(result.differing.begin(), result.differing.end(),
                   [](const BlockDifference& x, const BlockDifference& y) { return x.p < y.p; });
  return result;
}

}  // namespace candela::stats
