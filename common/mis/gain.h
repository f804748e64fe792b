// What optimal weights are worth for a pixel: the variance of crossfit (estimators.h) over that of the
// balance heuristic, from batches that are kept one by one.
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
  // 1 where nothing varies.
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
  // The slopes of a half are those of the other, as crossfit's are, so that what their noise costs is
  // counted: as many batches later it costs less. Zero if a half has fewer than two batches.
  Variances variances(int scale_log2) const;

 private:
  const Allocation allocation_;
  std::array<std::vector<Sums>, 2> halves_;
};

}  // namespace candela::mis
