// Measures the gain of optimal weights for a pixel: the variance of the crossfit estimator (estimators.h)
// over the variance of the balance heuristic, from the sums of single batches.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "common/mis/sums.h"

namespace candela::mis {

// Variances of one batch, summed over pixels and colors.
struct Variances {
  double balance = 0, crossfit = 0;
  void add(const Variances& other) {
    balance += other.balance;
    crossfit += other.crossfit;
  }
  // 1 if nothing varies.
  double ratio() const { return balance > 0 ? crossfit / balance : 1; }
};

// The batches of a pixel, in two halves.
class PixelBatches {
 public:
  explicit PixelBatches(const Allocation& allocation) : allocation_(allocation) {}
  void clear() {
    for (auto& half : halves_) half.clear();
  }
  // The sums of one batch.
  void add(std::size_t half, const Sums& batch) { halves_[half].push_back(batch); }
  // Each half takes its slopes from the other half, as crossfit does, so that the variance includes the noise
  // of slopes from this number of batches. Both variances are zero if a half has fewer than two batches.
  Variances variances(int scale_log2) const;

 private:
  const Allocation allocation_;
  std::array<std::vector<Sums>, 2> halves_;
};

}  // namespace candela::mis
