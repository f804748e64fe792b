// Pearson's chi-squared test for the unit tests: pools thin bins, returns the p-value.
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include "tests/statistical/quantiles.h"

namespace candela::test {

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
  return statistical::chi_squared_tail(statistic, bins - 1);
}

}  // namespace candela::test
