// Errors of images against a reference, and estimated from independent halves.
#include "common/stats/image_error.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace candela::stats {

namespace {

constexpr double kTrimmedFraction = 0.001;

double relative(double squared_error, double reference, double mean) {
  if (squared_error == 0) return 0;  // also where the reference is black all over
  return squared_error / (reference * reference + kDarkFraction * mean * mean);
}

// Calls visit(variance, mean) for each value of the image, row by row. `factor` is variance_factor()'s.
template <class Visit>
void visit_values(const film::MergedFilm& film, const film::Development& development, double factor,
                  Visit&& visit) {
  using Which = film::MergedFilm::Which;
  const std::size_t row_values = std::size_t{film.layout().width} * film::kChannels;
  std::vector<double> a(row_values), b(row_values), both(row_values), scaled(row_values);
  for (std::uint32_t y = 0; y < film.layout().height; ++y) {
    film::develop_image_row(film, development, y, Which::half0, a, scaled);
    film::develop_image_row(film, development, y, Which::half1, b, scaled);
    film::develop_image_row(film, development, y, Which::both, both, scaled);
    for (std::size_t i = 0; i < row_values; ++i) {
      double variance = (a[i] - b[i]) * (a[i] - b[i]) * factor;
      if (development.factor_variance > 0) variance += scaled[i] * scaled[i] * development.factor_variance;
      visit(variance, both[i]);
    }
  }
}

// The factor of (A-B)^2 that makes it an estimate of the pooled mean's variance. Of independent iterations:
// E (A-B)^2 = s (1/n0 + 1/n1) and Var M = s / (n0 + n1) for s the variance of one iteration. Of chains, the
// larger that is right where Var A = Var B however many segments each has.
double variance_factor(const film::MergedFilm& film, const film::Development& development) {
  const auto n0 = static_cast<double>(film.merged(0).count());
  const auto n1 = static_cast<double>(film.merged(1).count());
  if (n0 == 0 || n1 == 0) return std::numeric_limits<double>::quiet_NaN();
  const double w0 = n0 / (n0 + n1), w1 = n1 / (n0 + n1);
  return development.two_layers ? (w0 * w0 + w1 * w1) / 2 : w0 * w1;
}

}  // namespace

double relative_weight(double reference, double mean) {
  const double square = reference * reference + kDarkFraction * mean * mean;
  return square > 0 ? 1 / square : 0;
}

ImageComparison compare(std::span<const float> a, std::span<const float> b, std::uint32_t width,
                        std::uint32_t height, std::size_t worst_count) {
  ImageComparison result;
  const std::size_t pixels = std::size_t{width} * height;
  const std::size_t values = pixels * film::kChannels;
  if (values == 0) return result;
  double sum_a = 0, sum_b = 0, finite_sum_b = 0, squares = 0;
  std::size_t finite_b = 0;
  for (std::size_t i = 0; i < values; ++i) {
    sum_a += a[i];
    sum_b += b[i];
    if (std::isfinite(b[i])) {
      finite_sum_b += b[i];
      ++finite_b;
    }
    const double difference = double{a[i]} - double{b[i]};
    squares += difference * difference;
  }
  const auto count = static_cast<double>(values);
  result.mean_a = sum_a / count;
  result.mean_b = sum_b / count;
  result.mean_ratio = sum_b == 0 ? std::numeric_limits<double>::quiet_NaN() : result.mean_a / result.mean_b;
  result.rmse = std::isfinite(squares) ? std::sqrt(squares / count) : std::numeric_limits<double>::infinity();

  const double reference_mean = finite_b == 0 ? 0 : finite_sum_b / static_cast<double>(finite_b);
  std::vector<double> errors(pixels);
  double total = 0;
  for (std::size_t p = 0; p < pixels; ++p) {
    double error = 0;
    for (std::size_t i = p * film::kChannels; i < (p + 1) * film::kChannels; ++i) {
      const double difference = double{a[i]} - double{b[i]};
      error += std::isfinite(difference) ? relative(difference * difference, b[i], reference_mean)
                                         : std::numeric_limits<double>::infinity();
    }
    errors[p] = error / film::kChannels;
    total += errors[p];
  }
  result.relmse = total / static_cast<double>(pixels);

  // Worst first; of equals the one nearest the top left, so that the list is one and the same everywhere.
  std::vector<std::size_t> order(pixels);
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto trimmed = static_cast<std::size_t>(kTrimmedFraction * static_cast<double>(pixels));
  const std::size_t sorted = std::min(pixels, std::max(worst_count, trimmed));
  std::partial_sort(
      order.begin(), order.begin() + static_cast<std::ptrdiff_t>(sorted), order.end(),
      [&](std::size_t p, std::size_t q) { return errors[p] != errors[q] ? errors[p] > errors[q] : p < q; });
  for (std::size_t i = 0; i < std::min(worst_count, pixels); ++i) {
    const std::size_t p = order[i];
    result.worst.push_back({static_cast<std::uint32_t>(p % width),
                            static_cast<std::uint32_t>(p / width),
                            errors[p],
                            {a[3 * p], a[3 * p + 1], a[3 * p + 2]},
                            {b[3 * p], b[3 * p + 1], b[3 * p + 2]}});
  }
  for (std::size_t i = 0; i < trimmed; ++i) errors[order[i]] = 0;
  result.relmse_trimmed =
      std::accumulate(errors.begin(), errors.end(), 0.0) / static_cast<double>(pixels - trimmed);
  return result;
}

ErrorEstimate estimate_error(const film::MergedFilm& film, const film::Development& development) {
  const double factor = variance_factor(film, development);
  const auto values = static_cast<double>(film.layout().pixel_count() * film::kChannels);
  ErrorEstimate estimate;
  double sum = 0, variance_sum = 0;
  visit_values(film, development, factor, [&](double variance, double both) {
    sum += both;
    variance_sum += variance;
  });
  estimate.mean = sum / values;
  estimate.rmse = std::sqrt(variance_sum / values);
  if (std::isnan(factor)) {
    estimate.relmse = factor;
    return estimate;
  }
  double relative_sum = 0;
  visit_values(film, development, factor, [&](double variance, double both) {
    relative_sum += relative(variance, both, estimate.mean);
  });
  estimate.relmse = relative_sum / values;
  return estimate;
}

std::vector<float> variance_map(const film::MergedFilm& film, const film::Development& development) {
  std::vector<float> map;
  map.reserve(film.layout().pixel_count() * film::kChannels);
  visit_values(film, development, variance_factor(film, development),
               [&](double variance, double) { map.push_back(static_cast<float>(variance)); });
  return map;
}

std::vector<float> error_map(const film::MergedFilm& film, const film::Development& development) {
  std::vector<float> map;
  map.reserve(film.layout().pixel_count() * film::kChannels);
  visit_values(film, development, variance_factor(film, development),
               [&](double variance, double) { map.push_back(static_cast<float>(std::sqrt(variance))); });
  return map;
}

}  // namespace candela::stats
