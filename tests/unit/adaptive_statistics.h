// The statistics of the tests of radii in double: the references of f_exceeds() and counts_exceed().
#pragma once

#include <numeric>
#include <span>

#include "common/adaptive/chi_squared_counts.h"
#include "common/adaptive/f_test.h"

namespace candela::adaptive {

// F [Lin 2023, Eq. 7]; 0 if Q is not above 0.
inline double f_statistic(const SectorSums& sums) {
  if (sums.squares <= 0) return 0;
  const auto n = static_cast<double>(sums.sums.size());
  double total = 0;
  for (const Int128 sum : sums.sums) total += static_cast<double>(sum);
  const double mean = total / n;
  double deviation = 0;
  for (const Int128 sum : sums.sums) {
    const double d = static_cast<double>(sum) - mean;
    deviation += d * d;
  }
  const double squares =
      static_cast<double>(sums.squares) * static_cast<double>(std::uint64_t{1} << sums.square_shift);
  return n / (n - 1) * deviation / squares;
}

// n sum c^2 / C - C, C = sum c; 0 if there are no photons.
inline double counts_statistic(std::span<const Int128> counts) {
  const auto total = static_cast<double>(std::accumulate(counts.begin(), counts.end(), Int128{0}));
  if (total == 0) return 0;
  const auto n = static_cast<double>(counts.size());
  double deviation = 0;
  for (const Int128 count : counts) {
    const double d = static_cast<double>(count) - total / n;
    deviation += d * d;
  }
  return n * deviation / total;
}

}  // namespace candela::adaptive
