#include "common/mis/gain.h"

#include "common/mis/estimators.h"

namespace candela::mis {
namespace {

// The running variance of a series of values (Welford's update).
struct RunningVariance {
  double count = 0, mean = 0, squares = 0;
  void add(double value) {
    const double off = value - mean;
    mean += off / ++count;
    squares += off * (value - mean);
  }
  double variance() const { return squares / (count - 1); }
};

}  // namespace

Variances PixelBatches::variances(int scale_log2) const {
  Variances out;
  if (halves_[0].size() < 2 || halves_[1].size() < 2) return out;
  for (std::size_t half = 0; half < 2; ++half) {
    Sums others;
    for (const Sums& batch : halves_[1 - half]) others.add(batch);
    const Slopes slopes = ridge_slopes(allocation_, others, scale_log2);
    std::array<RunningVariance, kColors> balance, crossfit;
    for (const Sums& batch : halves_[half]) {
      const Color more = correction(allocation_, batch, slopes);
      for (std::size_t k = 0; k < kColors; ++k) {
        const double sum = batch.balance_sum(allocation_, k);
        balance[k].add(sum);
        crossfit[k].add(sum + more[k]);
      }
    }
    for (std::size_t k = 0; k < kColors; ++k)
      out.add({balance[k].variance() / 2, crossfit[k].variance() / 2});
  }
  return out;
}

}  // namespace candela::mis
