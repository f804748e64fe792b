// The limit of an estimator whose expectation approaches it as limit + c h^order: two of them, at h and at h
// / ratio, make one without that term [Richardson 1911]. What follows it, d h^p say, is left, times (1 -
// ratio^(order - p)) / (1 - ratio^order): for order 1, p 2 and ratio 2 minus half of what h itself has.
//   kernels of radius r                                             h = r
//   means over N iterations of progressive kernels [Knaus 2011]     h = 1 / N, order 1 - alpha
#pragma once

#include <cmath>
#include <cstddef>
#include <span>
#include <stdexcept>

#include "tests/statistical/moments.h"

namespace candela::statistical {

// Weights of the two estimates. They sum to one.
struct Extrapolation {
  double fine = 2, coarse = -1;
};

// Where there is no bias that falls (order 0: alpha = 1) or no second size there is nothing to extrapolate.
inline Extrapolation extrapolation(double ratio, double order) {
  const double factor = std::pow(ratio, order);
  if (!(factor > 1) || std::isinf(factor)) throw std::invalid_argument("extrapolation from one size");
  return {factor / (factor - 1), -1 / (factor - 1)};
}
// From radius r to r / 2, the bias being linear: edges of shadows and objects.
inline Extrapolation over_half_radius() {
  return extrapolation(2, 1);
}
// From the means of n and of more iterations, n_fine.
inline Extrapolation over_iterations(double n_coarse, double n_fine, double alpha) {
  return extrapolation(n_fine / n_coarse, 1 - alpha);
}

// Of replicates that have both: the k-th of `fine` may be correlated with the k-th of `coarse` as it likes,
// since only replicates are compared, each extrapolated by itself. The mean is the limit, error() its
// standard error.
inline Moments extrapolate(std::span<const double> coarse, std::span<const double> fine,
                           const Extrapolation& by) {
  if (coarse.size() != fine.size()) throw std::invalid_argument("replicates that are no pairs");
  Moments limit;
  for (std::size_t k = 0; k < fine.size(); ++k) limit.add(by.fine * fine[k] + by.coarse * coarse[k]);
  return limit;
}

}  // namespace candela::statistical
