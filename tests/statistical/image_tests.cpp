#include "tests/statistical/image_tests.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "tests/proofs/proofs.h"
#include "tests/statistical/moments.h"
#include "tests/statistical/quantiles.h"

namespace candela::statistical {
namespace {

// What the verdict depends on beside the batches.
void note(const std::vector<float>& reference, const std::vector<float>& reference_stderr,
          const BlockTestOptions& options) {
  proofs::fact("reference", reference);
  proofs::fact("standard error of the reference", reference_stderr);
  std::string text = fmt::format("{} {} {}", options.block, options.max_relative_error, options.allowed_bias);
  for (const auto* blocks : {&options.excluded, &options.only_brighter}) {
    text += ';';
    for (const auto& [x, y] : *blocks) text += fmt::format(" {},{}", x, y);
  }
  proofs::fact("block test", text);
}

}  // namespace

BlockTestResult block_test(const std::vector<std::vector<float>>& batches,
                           const std::vector<float>& reference, const std::vector<float>& reference_stderr,
                           std::uint32_t width, std::uint32_t height, const BlockTestOptions& options) {
  constexpr double kKnown = std::numeric_limits<double>::infinity();  // freedom of a variance that is
  const std::uint32_t block = options.block;
  BlockTestResult result;
  if (proofs::probing()) {
    note(reference, reference_stderr, options);
    result.tested = 1;
    result.ratio = 1;
    return result;
  }
  double chi_squared = 0, weights = 0, weighted = 0, reference_squares = 0;
  std::vector<double> ratios(batches.size(), 0.0);  // of each batch, not yet divided by the weights
  std::vector<double> relative_errors;
  for (std::uint32_t by = 0; by < height; by += block) {
    for (std::uint32_t bx = 0; bx < width; bx += block) {
      const auto listed = [&](const auto& blocks) {
        return std::find(blocks.begin(), blocks.end(), std::pair(bx, by)) != blocks.end();
      };
      if (listed(options.excluded)) continue;
      const bool only_brighter = listed(options.only_brighter);
      for (std::uint32_t channel = 0; channel < 3; ++channel) {
        std::vector<double> means(batches.size(), 0.0);
        double expected = 0, expected_variance = 0, pixels = 0;
        for (std::uint32_t y = by; y < std::min(by + block, height); ++y) {
          for (std::uint32_t x = bx; x < std::min(bx + block, width); ++x) {
            const std::size_t i = (std::size_t{y} * width + x) * 3 + channel;
            for (std::size_t k = 0; k < batches.size(); ++k) means[k] += static_cast<double>(batches[k][i]);
            expected += static_cast<double>(reference[i]);
            if (!reference_stderr.empty())
              expected_variance +=
                  static_cast<double>(reference_stderr[i]) * static_cast<double>(reference_stderr[i]);
            pixels += 1;
          }
        }
        expected /= pixels;
        expected_variance /= pixels * pixels;
        Moments own;
        for (double& value : means) own.add(value /= pixels);
        const double mean = own.mean();
        double largest = 0;
        for (const double value : means) largest = std::max(largest, (value - mean) * (value - mean));
        // Rounding of floats and of the analytic answer itself, so that exact agreement is not tested for
        // exact zero variance.
        const double rounding = 1e-6 * std::max(std::fabs(expected), std::fabs(mean));
        const double own_variance = own.variance_of_mean();
        // The reference's own degrees of freedom are taken as at least 7 (its README: 8 to 30 runs).
        const EstimatedVariance sum = EstimatedVariance{own_variance, own.freedom()} +
                                      EstimatedVariance{expected_variance, 7} +
                                      EstimatedVariance{rounding * rounding, kKnown};
        const double variance = sum.variance, deviation = std::sqrt(variance);
        if (expected == 0 && mean == 0) continue;
        if (deviation > options.max_relative_error * std::fabs(expected) ||
            (largest > 0.8 * own.variance() * own.freedom() && own_variance > expected_variance &&
             own_variance > rounding * rounding)) {
          ++result.skipped;
          continue;
        }
        ++result.tested;
        const double difference = only_brighter ? std::max(0.0, mean - expected) : mean - expected;
        const double beyond =
            std::max(0.0, std::fabs(difference) - options.allowed_bias * std::fabs(expected));
        const double t = t_statistic(std::copysign(beyond, difference), deviation);
        const double p = std::max(student_two_sided(t, sum.freedom), 1e-300);
        const double score = normal_quantile(p / 2);
        chi_squared += score * score;
        relative_errors.push_back(deviation / std::fabs(expected));
        const double weight = only_brighter ? 0 : expected * expected / variance;
        weights += weight;
        weighted += weight * mean / expected;
        for (std::size_t k = 0; k < batches.size(); ++k) ratios[k] += weight * means[k] / expected;
        reference_squares += weight * weight * expected_variance / (expected * expected);
        if (p < result.smallest_p) {
          result.smallest_p = p;
          result.worst =
              fmt::format("block at ({}, {}), channel {}: {} against {}, standard error {}, t = {:.2f}", bx,
                          by, channel, mean, expected, deviation, t);
        }
      }
    }
  }
  if (result.tested > 0) {
    result.adjusted_p = std::min(1.0, result.smallest_p * static_cast<double>(result.tested));
    result.chi_squared_p = chi_squared_tail(chi_squared, static_cast<double>(result.tested));
    std::nth_element(relative_errors.begin(), relative_errors.begin() + relative_errors.size() / 2,
                     relative_errors.end());
    result.median_relative_standard_error = relative_errors[relative_errors.size() / 2];
    result.ratio = weighted / weights;
    Moments spread;
    for (const double ratio : ratios) spread.add(ratio / weights);
    result.ratio_stderr = std::sqrt(spread.variance_of_mean() + 3 * reference_squares / (weights * weights));
  }
  return result;
}

}  // namespace candela::statistical
