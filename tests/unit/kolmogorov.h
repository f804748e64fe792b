// Kolmogorov and Smirnov's tests for the unit tests.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace candela::test {

// p-value of n independent samples' empirical distribution being `largest` away from the true one, or more.
// Asymptotic, with Stephens's correction for finite n.
inline double kolmogorov_p(double largest, double n) {
  const double t = (std::sqrt(n) + 0.12 + 0.11 / std::sqrt(n)) * largest;
  double sum = 0;
  for (int k = 1; k < 100; ++k) sum += (k % 2 == 1 ? 2 : -2) * std::exp(-2 * k * k * t * t);
  return t < 0.2 ? 1 : std::clamp(sum, 0.0, 1.0);  // below, the series converges slowly; p is 1 to 1e-12
}

// p-value of two samples having one distribution.
inline double two_sample_kolmogorov_p(std::vector<double> a, std::vector<double> b) {
  std::sort(a.begin(), a.end());
  std::sort(b.begin(), b.end());
  const auto na = static_cast<double>(a.size()), nb = static_cast<double>(b.size());
  double largest = 0;
  for (std::size_t i = 0, j = 0; i < a.size() && j < b.size();) {
    const double at = std::min(a[i], b[j]);
    while (i < a.size() && a[i] <= at) ++i;
    while (j < b.size() && b[j] <= at) ++j;
    largest = std::max(largest, std::abs(static_cast<double>(i) / na - static_cast<double>(j) / nb));
  }
  return kolmogorov_p(largest, na * nb / (na + nb));
}

}  // namespace candela::test
