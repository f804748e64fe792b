#include "tests/bench/candela_study/mis_regression.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "common/mis/ldlt.h"

namespace candela::study {
namespace {

constexpr double kRank = 1e-9;
constexpr int kMaxSweeps = 40;

double product(const std::vector<double>& a, const std::vector<double>& b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

void rotate(std::vector<double>& a, std::vector<double>& b, double c, double s) {
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double x = a[i], y = b[i];
    a[i] = c * x - s * y;
    b[i] = s * x + c * y;
  }
}

}  // namespace

// Rotations V make the columns orthogonal: D V = U S, so that x = V S^-1 U' y.
std::vector<double> least_squares(std::vector<std::vector<double>> columns, const std::vector<double>& y) {
  const std::size_t n = columns.size();
  std::vector<std::vector<double>> v(n, std::vector<double>(n));
  for (std::size_t i = 0; i < n; ++i) v[i][i] = 1;
  for (int sweep = 0; sweep < kMaxSweeps; ++sweep) {
    bool rotated = false;
    for (std::size_t i = 0; i + 1 < n; ++i)
      for (std::size_t j = i + 1; j < n; ++j) {
        const double aa = product(columns[i], columns[i]), bb = product(columns[j], columns[j]);
        const double ab = product(columns[i], columns[j]);
        if (std::abs(ab) <= 1e-15 * std::sqrt(aa * bb)) continue;
        rotated = true;
        const double zeta = (bb - aa) / (2 * ab);
        const double t = std::copysign(1 / (std::abs(zeta) + std::hypot(1, zeta)), zeta);
        const double c = 1 / std::hypot(1, t);
        rotate(columns[i], columns[j], c, c * t);
        rotate(v[i], v[j], c, c * t);
      }
    if (!rotated) break;
  }
  double largest = 0;
  for (const auto& column : columns) largest = std::max(largest, product(column, column));
  std::vector<double> x(n);
  for (std::size_t i = 0; i < n; ++i) {
    const double square = product(columns[i], columns[i]);
    if (!(square > kRank * kRank * largest)) continue;
    const double share = product(columns[i], y) / square;
    for (std::size_t k = 0; k < n; ++k) x[k] += share * v[i][k];
  }
  return x;
}

double owen_zhou(const mis::Allocation& allocation, std::span<const MisSample> samples) {
  const double m = allocation.total();
  std::vector<std::vector<double>> columns(allocation.techniques + 1,
                                           std::vector<double>(samples.size(), 1.0));
  std::vector<double> y(samples.size());
  for (std::size_t l = 0; l < samples.size(); ++l) {
    y[l] = m * samples[l].f_over_q;
    for (std::size_t k = 0; k < allocation.techniques; ++k) columns[k + 1][l] = m * samples[l].c[k];
  }
  const std::vector<double> h = least_squares(std::move(columns), y);
  return std::accumulate(h.begin(), h.end(), 0.0);
}

// Columns of the regression: an intercept 1 and d_k = p_k / p_c = M c_k; y = f / p_c = M f / q.
double fan(const mis::Allocation& allocation, const mis::Sums& batch, std::size_t dropped) {
  constexpr double kLambda = 1;  // [Fan 2006]
  constexpr std::size_t kMaxColumns = mis::kMaxTechniques + 1;
  const std::size_t n = allocation.techniques;
  const double m = allocation.total();
  const mis::Vector r = batch.control_sums(allocation);
  std::array<std::array<double, kMaxColumns>, kMaxColumns> gram{};
  std::array<std::size_t, kMaxColumns> columns{};
  std::size_t count = 0;
  for (std::size_t column = 0; column <= n; ++column)
    if (column != dropped) columns[count++] = column;
  const auto product = [&](std::size_t i, std::size_t j) {  // i >= j
    if (i == 0) return batch.samples(allocation);
    return j == 0 ? m * r[i - 1] : m * m * batch.a[mis::packed(i - 1, j - 1)];
  };
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t j = 0; j <= i; ++j) gram[i][j] = product(columns[i], columns[j]);
    gram[i][i] += kLambda;
  }
  const mis::Ldlt<kMaxColumns> ldlt(gram, count, 0);
  std::array<double, kMaxColumns> rhs{};
  for (std::size_t i = 0; i < count; ++i)
    rhs[i] = columns[i] == 0 ? m * batch.balance_sum(allocation, 0) : m * m * batch.b[0][columns[i] - 1];
  const auto h = ldlt.solve(rhs);
  return std::accumulate(h.begin(), h.end(), 0.0);
}

}  // namespace candela::study
