#include "tests/statistical/block_tests.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <utility>

#include "tests/proofs/proofs.h"
#include "tests/statistical/moments.h"
#include "tests/statistical/quantiles.h"

namespace candela::statistical {
namespace {

constexpr double kScore90 = 1.2815515655446004;  // of the standard normal distribution at 0.9
// Sums of floats on the way to a film: exact agreement is not held against it.
constexpr double kRounding = 3e-6;
constexpr double kKnown = std::numeric_limits<double>::infinity();  // freedom of a variance that is

// Of one batch.
Moments moments(const Rows& rows, std::size_t value) {
  Moments m;
  for (const auto& row : rows) m.add(row[value]);
  return m;
}

// The difference, in standard errors, that exceeds t's quantile of this tail with probability 0.9, where the
// standard error is estimated too (normal approximation of the noncentral t).
double noticeable(double freedom, double probability) {
  const double threshold = student_quantile(probability, freedom);
  return threshold * (1 - 1 / (4 * freedom)) +
         kScore90 * std::sqrt(1 + threshold * threshold / (2 * freedom));
}

constexpr std::size_t kListed = 6;  // differences that a report lists

// How far a difference goes beyond the margin, in standard errors.
double excess(const Welch& w, const BlockTest& test) {
  if (test.only_brighter && w.mean_a < w.mean_b) return 0;
  return t_statistic(std::max(0.0, std::fabs(w.mean_a - w.mean_b) - test.margin * std::fabs(w.mean_b)),
                     w.deviation);
}

bool skewed(const Welch& w, const BlockTest& test) {
  // Skewness of the estimator that hardly adds to the error does no harm.
  return (w.share_a > 0.1 && std::fabs(w.skewness_a) > test.largest_skewness) ||
         (w.share_a < 0.9 && std::fabs(w.skewness_b) > test.largest_skewness);
}

std::string describe(const Regions& regions, std::size_t value, const Welch& w) {
  return fmt::format("{}: {:.6g} against {:.6g} ({:+.3f} %), standard error {:.2g} ({:+.1f} of them)",
                     regions.name(value), w.mean_a, w.mean_b,
                     100 * (w.mean_a - w.mean_b) / (w.mean_b != 0 ? w.mean_b : 1), w.deviation,
                     (w.mean_a - w.mean_b) / w.deviation);
}

}  // namespace

Regions::Regions(std::uint32_t width, std::uint32_t height, std::uint32_t block)
    : width_(width),
      height_(height),
      block_(block),
      columns_((width + block - 1) / block),
      rows_((height + block - 1) / block) {}

std::vector<double> Regions::means(std::span<const double> rgb) const {
  std::vector<double> sums(values(), 0.0);
  std::vector<double> counts(values(), 0.0);
  const std::size_t whole_image = std::size_t{columns_} * rows_;
  for (std::uint32_t y = 0; y < height_; ++y)
    for (std::uint32_t x = 0; x < width_; ++x) {
      const std::size_t region = std::size_t{y / block_} * columns_ + x / block_;
      for (std::size_t c = 0; c < 3; ++c) {
        const double v = rgb[(std::size_t{y} * width_ + x) * 3 + c];
        sums[region * 3 + c] += v;
        counts[region * 3 + c] += 1;
        sums[whole_image * 3 + c] += v;
        counts[whole_image * 3 + c] += 1;
      }
    }
  for (std::size_t i = 0; i < sums.size(); ++i) sums[i] /= counts[i];
  return sums;
}

std::string Regions::name(std::size_t value) const {
  const std::size_t region = value / 3;
  const char* const channel = &"r\0g\0b"[value % 3 * 2];
  if (whole(value)) return fmt::format("whole image, {}", channel);
  return fmt::format("block at ({}, {}), {}", region % columns_ * block_, region / columns_ * block_,
                     channel);
}

Estimator cached(Estimator estimator) {
  auto memory = std::make_shared<std::map<std::pair<std::uint64_t, double>, Rows>>();
  return {estimator.name, [estimator, memory](std::uint64_t stage, double effort) {
            auto& rows = (*memory)[{stage, effort}];
            if (rows.empty()) rows = estimator.rows(stage, effort);
            return rows;
          }};
}

Welch welch(const Rows& a, const Rows& b, std::size_t value) {
  const Moments ma = moments(a, value), mb = moments(b, value);
  Welch w;
  w.mean_a = ma.mean();
  w.mean_b = mb.mean();
  w.skewness_a = ma.skewness();
  w.skewness_b = mb.skewness();
  const double rounding = kRounding * std::max(std::fabs(w.mean_a), std::fabs(w.mean_b));
  const EstimatedVariance total = EstimatedVariance{ma.variance_of_mean(), ma.freedom()} +
                                  EstimatedVariance{mb.variance_of_mean(), mb.freedom()} +
                                  EstimatedVariance{rounding * rounding, kKnown};
  w.deviation = std::sqrt(total.variance);
  if (total.variance > 0) w.share_a = ma.variance_of_mean() / total.variance;
  w.freedom = total.freedom;
  return w;
}

double detectable(const Welch& w, std::size_t values, const BlockTest& test) {
  if (w.mean_b == 0) return INFINITY;
  const double errors = noticeable(w.freedom, test.alpha_suspect / (2 * static_cast<double>(values)));
  return test.margin + errors * w.deviation / std::fabs(w.mean_b);
}

double effort_for(const Rows& rows, const Regions& regions, double target, std::size_t batches, double share,
                  const BlockTest& test) {
  const auto n = static_cast<double>(batches);
  const double freedom = n - 1;  // the least Welch can give
  const double errors = noticeable(freedom, test.alpha_suspect / (2 * static_cast<double>(regions.values())));
  double effort = 1;
  for (std::size_t value = 0; value < regions.values(); ++value) {
    const Moments m = moments(rows, value);
    if (m.mean() == 0) continue;
    const double deviation = (target - test.margin) * std::fabs(m.mean()) / errors;
    effort = std::max(effort, 1.25 * m.variance() / share / n / (deviation * deviation));
  }
  return effort;
}

Verdict compare(const Estimator& tested, const Estimator& reference, const Regions& regions,
                const BlockTest& test) {
  const Rows a = tested.rows(1, test.effort), b = reference.rows(1, test.effort_reference);
  Verdict verdict;
  if (proofs::probing()) {
    proofs::fact("comparison",
                 fmt::format("{} {} {} {} {} {} {} {} {}", test.alpha_suspect, test.alpha_confirm,
                             test.confirm_effort, test.effort, test.effort_reference, test.margin,
                             test.decide, test.only_brighter, test.largest_skewness));
    verdict.values = verdict.tested = verdict.decided = 1;
    verdict.ratio = 1;
    return verdict;
  }
  std::vector<std::size_t> values;
  std::vector<Welch> results(regions.values());
  for (std::size_t value = 0; value < regions.values(); ++value) {
    results[value] = welch(a, b, value);
    if (results[value].mean_a == 0 && results[value].mean_b == 0) continue;
    ++verdict.values;
    if (!skewed(results[value], test)) values.push_back(value);
  }
  verdict.tested = values.size();

  std::vector<std::size_t> suspects;
  std::vector<double> detectables;
  std::string worst;
  double least = 2;
  for (const std::size_t value : values) {
    const Welch& w = results[value];
    const double p = student_two_sided(excess(w, test), w.freedom);
    if (p < least) {
      least = p;
      worst = describe(regions, value, w);
    }
    if (p * static_cast<double>(values.size()) < test.alpha_suspect) suspects.push_back(value);
    const double least_difference = detectable(w, values.size(), test);
    if (least_difference <= test.decide) ++verdict.decided;
    if (regions.whole(value))
      verdict.detectable_whole = std::max(verdict.detectable_whole, least_difference);
    else
      detectables.push_back(least_difference);
  }
  verdict.smallest_p = std::min(1.0, least * static_cast<double>(values.size()));
  verdict.suspects = suspects.size();
  if (!detectables.empty()) {
    std::sort(detectables.begin(), detectables.end());
    verdict.detectable_median = detectables[detectables.size() / 2];
    verdict.detectable_largest = detectables.back();
  }
  double sum_a = 0, sum_b = 0, error = 0;
  for (std::size_t value = 0; value < regions.values(); ++value)
    if (regions.whole(value)) {
      sum_a += results[value].mean_a;
      sum_b += results[value].mean_b;
      error += results[value].deviation;  // the channels are taken as one
    }
  verdict.ratio = sum_a / sum_b;
  verdict.ratio_error = error / sum_b;
  verdict.report = fmt::format(
      "{} against {}: {} of {} values tested, {} decided at {:.2g} %; ratio {:.5f} +- {:.5f}; detectable "
      "with probability 0.9: median block {:.2f} %, worst {:.2f} %, whole image {:.2f} %; adjusted p {:.3g}",
      tested.name, reference.name, verdict.tested, verdict.values, verdict.decided, 100 * test.decide,
      verdict.ratio, verdict.ratio_error, 100 * verdict.detectable_median, 100 * verdict.detectable_largest,
      100 * verdict.detectable_whole, verdict.smallest_p);
  if (suspects.empty()) return verdict;

  verdict.report += fmt::format("; {} suspect, worst {}", suspects.size(), worst);
  const Rows again_a = tested.rows(2, test.effort * test.confirm_effort);
  const Rows again_b = reference.rows(2, test.effort_reference * test.confirm_effort);
  std::size_t confirmed = 0;
  for (const std::size_t value : suspects) {
    const Welch w = welch(again_a, again_b, value);
    const bool same_side = (w.mean_a > w.mean_b) == (results[value].mean_a > results[value].mean_b);
    const double p = same_side ? student_tail(excess(w, test), w.freedom) : 1.0;
    if (p * static_cast<double>(suspects.size()) >= test.alpha_confirm) continue;
    if (++confirmed <= kListed) verdict.report += "\n  differs: " + describe(regions, value, w);
  }
  verdict.agree = confirmed == 0;
  verdict.report += verdict.agree ? "; none confirmed" : fmt::format("\n  {} values differ", confirmed);
  return verdict;
}

}  // namespace candela::statistical
