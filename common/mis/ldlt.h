// Solving small symmetric positive semidefinite systems, in one fixed order of operations: the same bits on
// every machine (docs/integrators/optimis.md).
#pragma once

#include <array>
#include <cstddef>
#include <utility>

namespace candela::mis {

// m = L D L' with the largest diagonal entry first. N: capacity.
template <std::size_t N>
class Ldlt {
 public:
  // `m`: the lower triangle of rows [0, n) is read. Pivots that are not above `min_pivot` end the
  // factorization: the unknowns left over are set to zero.
  Ldlt(std::array<std::array<double, N>, N> m, std::size_t n, double min_pivot) : m_(m), n_(n) {
    for (std::size_t i = 0; i < n_; ++i) order_[i] = i;
    for (rank_ = 0; rank_ < n_; ++rank_) {
      const std::size_t k = rank_;
      std::size_t best = k;
      for (std::size_t i = k + 1; i < n_; ++i)
        if (m_[i][i] > m_[best][best]) best = i;
      if (!(m_[best][best] > min_pivot)) break;
      swap(k, best);
      for (std::size_t i = k + 1; i < n_; ++i) {
        const double l = m_[i][k] / m_[k][k];
        for (std::size_t j = k + 1; j <= i; ++j) m_[i][j] -= l * m_[j][k];
      }
      for (std::size_t i = k + 1; i < n_; ++i) m_[i][k] /= m_[k][k];
    }
  }

  std::array<double, N> solve(const std::array<double, N>& rhs) const {
    std::array<double, N> y{}, x{};
    for (std::size_t i = 0; i < rank_; ++i) {
      y[i] = rhs[order_[i]];
      for (std::size_t j = 0; j < i; ++j) y[i] -= m_[i][j] * y[j];
    }
    for (std::size_t i = 0; i < rank_; ++i) y[i] /= m_[i][i];
    for (std::size_t i = rank_; i-- > 0;)
      for (std::size_t j = i + 1; j < rank_; ++j) y[i] -= m_[j][i] * y[j];
    for (std::size_t i = 0; i < rank_; ++i) x[order_[i]] = y[i];
    return x;
  }
  std::size_t rank() const { return rank_; }

 private:
  // Rows and columns a <= b of what is not factorized yet, and row entries of L.
  void swap(std::size_t a, std::size_t b) {
    if (a == b) return;
    std::swap(order_[a], order_[b]);
    for (std::size_t j = 0; j < a; ++j) std::swap(m_[a][j], m_[b][j]);
    std::swap(m_[a][a], m_[b][b]);
    for (std::size_t i = a + 1; i < b; ++i) std::swap(m_[i][a], m_[b][i]);
    for (std::size_t i = b + 1; i < n_; ++i) std::swap(m_[i][a], m_[i][b]);
  }

  std::array<std::array<double, N>, N> m_;  // L below the diagonal, D on it
  std::array<std::size_t, N> order_{};      // of the unknowns
  std::size_t n_, rank_ = 0;
};

}  // namespace candela::mis
