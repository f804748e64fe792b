#include "tests/bench/candela_study/mis_regression.h"

#include <algorithm>
#include <cmath>
#include <numeric>

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

}  // namespace candela::study
