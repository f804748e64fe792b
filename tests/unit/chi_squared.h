// Pearson's chi-squared test for the unit tests: pools thin bins, returns the p-value.
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

namespace candela::test {

// Q(a, x), the upper regularised incomplete gamma function, by series or continued fraction (Lentz).
inline double upper_gamma(double a, double x) {
  if (x <= 0) return 1;
  const double front = std::exp(a * std::log(x) - x - std::lgamma(a));
  if (x < a + 1) {
    double term = 1 / a;
    double sum = term;
    for (int n = 1; n < 10000 && term > sum * 1e-15; ++n) {
      term *= x / (a + n);
      sum += term;
    }
    return 1 - front * sum;
  }
  double b = x + 1 - a;
  double c = 1e300;
  double d = 1 / b;
  double h = d;
  for (int n = 1; n < 10000; ++n) {
    const double an = -n * (n - a);
    b += 2;
    d = an * d + b;
    if (std::abs(d) < 1e-300) d = 1e-300;
    c = b + an / c;
    if (std::abs(c) < 1e-300) c = 1e-300;
    d = 1 / d;
    h *= d * c;
    if (std::abs(d * c - 1) < 1e-14) break;
  }
  return front * h;
}

// p-value of the counts given what was expected of them (same total). Bins expecting fewer than 5 are pooled;
// a count in a bin that expects nothing at all fails outright (p = 0).
inline double chi_squared_p(const std::vector<double>& observed, const std::vector<double>& expected) {
  double pooled_observed = 0;
  double pooled_expected = 0;
  double statistic = 0;
  int bins = 0;
  for (std::size_t i = 0; i < observed.size(); ++i) {
    if (expected[i] < 5) {
      pooled_observed += observed[i];
      pooled_expected += expected[i];
      continue;
    }
    const double d = observed[i] - expected[i];
    statistic += d * d / expected[i];
    ++bins;
  }
  if (pooled_expected >= 5) {
    const double d = pooled_observed - pooled_expected;
    statistic += d * d / pooled_expected;
    ++bins;
  } else if (pooled_observed > pooled_expected + 8 * std::sqrt(pooled_expected) + 8) {
    return 0;
  }
  if (bins < 2) return 1;
  return upper_gamma(0.5 * (bins - 1), 0.5 * statistic);
}

}  // namespace candela::test
