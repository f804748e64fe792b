// The samples of one batch that has one sample of each technique, and their sums (sums.h) for a fixed number
// of techniques: what a tally adds for each pixel and iteration.
#pragma once

#include <array>
#include <cstddef>

#include "common/mis/sums.h"

namespace candela::mis {

// By the order in which sums add them.
struct Batch {
  std::array<Vector, kMaxTechniques> c{};
  std::array<Color, kMaxTechniques> f_over_q{};  // zero: dark or failed
};

inline Sums sums_of(std::size_t techniques, const Batch& batch) {
  Sums sums;
  for (std::size_t sample = 0; sample < techniques; ++sample)
    sums.add(techniques, batch.c[sample], batch.f_over_q[sample]);
  return sums;
}

// The entries of S_A, packed, and of S_b, by color and technique: those of sums_of() to the last bit.
template <std::size_t kTechniques>
std::array<double, packed_size(kTechniques)> matrix_of(const Batch& batch) {
  std::array<double, packed_size(kTechniques)> a{};
  for (std::size_t sample = 0; sample < kTechniques; ++sample) {
    const Vector& c = batch.c[sample];
    for (std::size_t i = 0; i < kTechniques; ++i)
      for (std::size_t j = 0; j <= i; ++j) a[packed(i, j)] += c[i] * c[j];
  }
  return a;
}
template <std::size_t kTechniques>
std::array<double, kColors * kTechniques> vector_of(const Batch& batch) {
  std::array<double, kColors * kTechniques> b{};
  for (std::size_t sample = 0; sample < kTechniques; ++sample)
    for (std::size_t k = 0; k < kColors; ++k)
      for (std::size_t i = 0; i < kTechniques; ++i)
        b[k * kTechniques + i] += batch.f_over_q[sample][k] * batch.c[sample][i];
  return b;
}

// Whether any sample has light.
template <std::size_t kTechniques>
bool lit(const Batch& batch) {
  bool any = false;
  for (std::size_t sample = 0; sample < kTechniques; ++sample)
    for (const double f : batch.f_over_q[sample]) any |= f != 0;
  return any;
}

}  // namespace candela::mis
