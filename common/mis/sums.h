// Sufficient statistics of optimal multiple importance sampling [Kondapaneni 2019].
//
// q    sum of n_i p_i; c_i = p_i / q, so that the sum of n_i c_i is 1: the controls of one sample
// f    the integrand, with all that the densities leave out
// S_A  sum of c c' over all samples of all batches: c_i c_j in [0, 1 / (n_i n_j)]
// S_b  sum of (f / q) c, one vector for each color channel
//
// Everything else follows from them: S_r = S_A n, the sum of the controls; W = n' S_A n, the number of
// samples; S_F = n' S_b, the sum of the balance heuristic's estimates. A sample without light is a sample:
//   dark      f = 0; c from the true densities
//   failed    the technique was asked and gave nothing: c = e_i / n_i, f = 0
//   delta     one technique alone can find it: c = e_i / n_i, f / q = f / (n_i p_i)
//   rejected  not a number or infinite: c is added, f is not
// Without them the expectation of S_r is not the number of batches, and the image is biased.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>

#include "common/mis/heuristics.h"

namespace candela::mis {

inline constexpr std::size_t kColors = 3;
using Color = std::array<double, kColors>;
using Vector = std::array<double, kMaxTechniques>;

// Entries of a symmetric matrix, row by row: (0,0), (1,0), (1,1), (2,0), ...
constexpr std::size_t packed_size(std::size_t n) {
  return n * (n + 1) / 2;
}
constexpr std::size_t packed(std::size_t i, std::size_t j) {
  return i >= j ? packed_size(i) + j : packed_size(j) + i;
}

// The controls of a point, from the densities of all techniques there.
struct Controls {
  Vector c{};
  double largest = 0;  // density
  double sum = 0;      // of n_i p_i / largest
  // f / q, without forming q, which may be beyond the range of numbers.
  double over_q(double f) const { return f / largest / sum; }
};

// Precondition: some density is > 0, and all are finite.
inline Controls controls(const Allocation& allocation, std::span<const double> densities) {
  Controls out;
  for (std::size_t i = 0; i < allocation.techniques; ++i) out.largest = std::max(out.largest, densities[i]);
  for (std::size_t i = 0; i < allocation.techniques; ++i) {
    out.c[i] = densities[i] / out.largest;
    out.sum += allocation.counts[i] * out.c[i];
  }
  for (std::size_t i = 0; i < allocation.techniques; ++i) out.c[i] /= out.sum;
  return out;
}
// The same controls to the last bit, for densities that are zero beyond the techniques: in whole registers.
// Precondition: as above.
template <std::size_t kLanes>
inline void controls_in_lanes(const Allocation& allocation, const Vector& densities, Vector& c) {
  double largest = 0, sum = 0;
  for (std::size_t i = 0; i < kLanes; ++i) largest = std::max(largest, densities[i]);
  for (std::size_t i = 0; i < kLanes; ++i) c[i] = densities[i] / largest;
  for (std::size_t i = 0; i < kLanes; ++i) sum += allocation.counts[i] * c[i];
  for (std::size_t i = 0; i < kLanes; ++i) c[i] /= sum;
}
inline Vector control_vector(const Allocation& allocation, const Vector& densities) {
  Vector c{};
  if (allocation.techniques <= kMaxTechniques / 2)
    controls_in_lanes<kMaxTechniques / 2>(allocation, densities, c);
  else
    controls_in_lanes<kMaxTechniques>(allocation, densities, c);
  return c;
}
// Controls of a sample that technique i alone can have made.
inline Vector controls_of_one(const Allocation& allocation, std::size_t i) {
  Vector c{};
  c[i] = 1 / allocation.counts[i];
  return c;
}

struct Sums {
  std::array<double, packed_size(kMaxTechniques)> a{};  // S_A
  std::array<Vector, kColors> b{};                      // S_b

  // A sample that brings f / q of light; zero: dark or failed.
  void add(std::size_t techniques, const Vector& c, const Color& f_over_q) {
    for (std::size_t i = 0; i < techniques; ++i)
      for (std::size_t j = 0; j <= i; ++j) a[packed(i, j)] += c[i] * c[j];
    for (std::size_t k = 0; k < kColors; ++k)
      if (f_over_q[k] != 0)
        for (std::size_t i = 0; i < techniques; ++i) b[k][i] += f_over_q[k] * c[i];
  }
  // Sets the sums of so many techniques to zero. Precondition: all further sums are zero.
  void clear(std::size_t techniques) {
    std::fill_n(a.begin(), packed_size(techniques), 0.0);
    for (Vector& color : b) std::fill_n(color.begin(), techniques, 0.0);
  }
  void add(const Sums& other) {
    for (std::size_t i = 0; i < a.size(); ++i) a[i] += other.a[i];
    for (std::size_t k = 0; k < kColors; ++k)
      for (std::size_t i = 0; i < kMaxTechniques; ++i) b[k][i] += other.b[k][i];
  }

  Vector control_sums(const Allocation& n) const {  // S_r
    Vector r{};
    for (std::size_t i = 0; i < n.techniques; ++i)
      for (std::size_t j = 0; j < n.techniques; ++j) r[i] += a[packed(i, j)] * n.counts[j];
    return r;
  }
  double samples(const Allocation& n) const {  // W
    const Vector r = control_sums(n);
    double sum = 0;
    for (std::size_t i = 0; i < n.techniques; ++i) sum += n.counts[i] * r[i];
    return sum;
  }
  double balance_sum(const Allocation& n, std::size_t color) const {  // S_F
    double sum = 0;
    for (std::size_t i = 0; i < n.techniques; ++i) sum += n.counts[i] * b[color][i];
    return sum;
  }
};

}  // namespace candela::mis
