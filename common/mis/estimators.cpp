#include "common/mis/estimators.h"

#include <algorithm>
#include <cmath>

#include "common/mis/ldlt.h"

namespace candela::mis {
namespace {

constexpr double kMinPivot = 1e-10;  // of the number of batches, without a ridge

// C_ij = s_i s_j (S_A,ij - S_r,i S_r,j / W), d_i = s_i (S_b,i - S_r,i S_F / W), s_i = sqrt(n_i):
// the second moments of the controls about their mean. W comes from S_A, so that rounding leaves the null
// vector s where it is. Centering takes the intercept out of the ridge.
template <std::size_t kCapacity>
Slopes solve_in(const Allocation& allocation, const Sums& sums, double ridge) {
  Slopes slopes{};
  const std::size_t n = allocation.techniques;
  const Vector r = sums.control_sums(allocation);
  double samples = 0;
  for (std::size_t i = 0; i < n; ++i) samples += allocation.counts[i] * r[i];
  if (!(samples > 0)) return slopes;
  Vector s{};
  for (std::size_t i = 0; i < n; ++i) s[i] = std::sqrt(allocation.counts[i]);
  std::array<std::array<double, kCapacity>, kCapacity> matrix{};
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j <= i; ++j)
      matrix[i][j] = s[i] * s[j] * (sums.a[packed(i, j)] - r[i] * r[j] / samples);
    matrix[i][i] += ridge;
  }
  const double min_pivot = ridge > 0 ? 0 : kMinPivot * samples / allocation.total();
  const Ldlt<kCapacity> ldlt(matrix, n, min_pivot);
  for (std::size_t k = 0; k < kColors; ++k) {
    const double mean = sums.balance_sum(allocation, k) / samples;
    std::array<double, kCapacity> d{};
    for (std::size_t i = 0; i < n; ++i) d[i] = s[i] * (sums.b[k][i] - r[i] * mean);
    const std::array<double, kCapacity> beta = ldlt.solve(d);
    for (std::size_t i = 0; i < n; ++i) slopes[k][i] = beta[i] * s[i];
  }
  return slopes;
}

// Zero while there is no second batch.
Slopes direct_slopes(const Allocation& allocation, const Sums& all, int scale_log2) {
  const double samples = all.samples(allocation);
  if (samples < 1.5 * allocation.total()) return {};
  return ridge_slopes(allocation, all, scale_log2);
}

}  // namespace

Slopes solve(const Allocation& allocation, const Sums& sums, double ridge) {
  // Small systems in little memory.
  if (allocation.techniques <= 2) return solve_in<2>(allocation, sums, ridge);
  if (allocation.techniques <= 4) return solve_in<4>(allocation, sums, ridge);
  return solve_in<kMaxTechniques>(allocation, sums, ridge);
}

Color correction(const Allocation& allocation, const Sums& sums, const Slopes& slopes) {
  const Vector r = sums.control_sums(allocation);
  double samples = 0;
  for (std::size_t i = 0; i < allocation.techniques; ++i) samples += allocation.counts[i] * r[i];
  const double batches = samples / allocation.total();
  Color out{};
  for (std::size_t k = 0; k < kColors; ++k)
    for (std::size_t i = 0; i < allocation.techniques; ++i) out[k] += slopes[k][i] * (batches - r[i]);
  return out;
}

double ridge(const Allocation& allocation, double samples, int scale_log2, double factor) {
  const double batches = samples / allocation.total();
  const double rounding = std::ldexp(
      8 * static_cast<double>(allocation.techniques) * std::sqrt(std::max(samples, 0.0)), -scale_log2);
  return batches > 0 ? std::max(factor / batches, rounding) : 1;
}

Slopes ridge_slopes(const Allocation& allocation, const Sums& sums, int scale_log2) {
  return solve(allocation, sums, ridge(allocation, sums.samples(allocation), scale_log2));
}

std::array<Color, 2> direct_halves(const Allocation& allocation, const Sums& half0, const Sums& half1,
                                   int scale_log2) {
  Sums all = half0;
  all.add(half1);
  const Slopes slopes = direct_slopes(allocation, all, scale_log2);
  return {correction(allocation, half0, slopes), correction(allocation, half1, slopes)};
}

std::array<Color, 2> crossfit_halves(const Allocation& allocation, const Sums& half0, const Sums& half1,
                                     int scale_log2) {
  const auto slopes_of = [&](const Sums& half) { return ridge_slopes(allocation, half, scale_log2); };
  return {correction(allocation, half0, slopes_of(half1)), correction(allocation, half1, slopes_of(half0))};
}

}  // namespace candela::mis
