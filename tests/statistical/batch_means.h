// The error of the mean of a series whose members are correlated with those near them, as the states of a
// Markov chain are: means over long batches are nearly independent, and vary as the mean does [Conway 1963].
// What is left of the correlation, with a correlation length of tau members and batches of m, makes the error
// too small by about tau / m of it.
#pragma once

#include <cstddef>
#include <span>
#include <stdexcept>

#include "tests/statistical/moments.h"

namespace candela::statistical {

struct BatchMeans {
  Moments batches;  // their means: batches.mean(), batches.error() with batches.freedom()
  Moments members;
  // How many independent members would tell the mean as well; of a series that does not vary, as many as
  // there are.
  double effective() const {
    const double of_mean = batches.variance_of_mean();
    return of_mean > 0 ? members.variance() / of_mean : static_cast<double>(members.count());
  }
};

// Of `batches` batches of equal length, at least 2; what does not fill the last one is left out at the
// beginning, where a chain is least likely to have forgotten its start.
inline BatchMeans batch_means(std::span<const double> series, std::size_t batches) {
  if (batches < 2 || series.size() < batches)
    throw std::invalid_argument("batch means of fewer than two batches, or of empty ones");
  const std::size_t length = series.size() / batches;
  const std::span<const double> used = series.last(length * batches);
  BatchMeans result;
  for (std::size_t batch = 0; batch < batches; ++batch) {
    const Moments one = moments_of(used.subspan(batch * length, length));
    result.batches.add(one.mean());
    result.members.merge(one);
  }
  return result;
}

}  // namespace candela::statistical
