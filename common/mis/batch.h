// The samples of one batch that has one sample of each technique, and their sums (sums.h) for a fixed number
// of techniques: what a tally adds for each pixel and iteration.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <utility>

#include "common/mis/sums.h"

namespace candela::mis {

struct Sample {
  Vector c{};
  Color f_over_q{};  // zero: dark or failed
};

// By the order in which sums add them.
struct Batch {
  std::array<Sample, kMaxTechniques> samples{};
  bool lit = false;  // else every f_over_q is zero
};

inline Sums sums_of(std::size_t techniques, const Batch& batch) {
  Sums sums;
  for (std::size_t s = 0; s < techniques; ++s)
    sums.add(techniques, batch.samples[s].c, batch.samples[s].f_over_q);
  return sums;
}

// kCount values in whole registers of four; those beyond are no larger.
template <std::size_t kCount>
using InFours = std::array<double, (kCount + 3) / 4 * 4>;

namespace in_registers {

using Four = double __attribute__((vector_size(32)));
using Lanes = long long __attribute__((vector_size(32)));

// Row and column of a packed entry.
struct Entry {
  std::size_t i = 0, j = 0;
};
constexpr Entry entry(std::size_t index) {
  Entry e;
  while (packed_size(e.i + 1) <= index) ++e.i;
  e.j = index - packed_size(e.i);
  return e;
}

inline Four load(const Vector& c) {
  Four four;
  std::memcpy(&four, c.data(), sizeof four);
  return four;
}
template <class Array>
void store(const Four& four, std::size_t index, Array& out) {
  std::memcpy(out.data() + 4 * index, &four, sizeof four);
}

// The sum over all samples of f(sample, c) for at most four techniques.
template <std::size_t kTechniques, class F>
Four sum_over(const Batch& batch, const F& f) {
  static_assert(kTechniques <= 4);
  Four sum = f(batch.samples[0], load(batch.samples[0].c));
  for (std::size_t s = 1; s < kTechniques; ++s) sum += f(batch.samples[s], load(batch.samples[s].c));
  return sum;
}

// Lanes beyond the last entry have the first.
template <std::size_t kTechniques, std::size_t kFour>
Four matrix_part(const Batch& batch) {
  constexpr auto row = [](std::size_t lane) -> long long {
    const std::size_t index = 4 * kFour + lane;
    return index < packed_size(kTechniques) ? static_cast<long long>(entry(index).i) : 0;
  };
  constexpr auto column = [](std::size_t lane) -> long long {
    const std::size_t index = 4 * kFour + lane;
    return index < packed_size(kTechniques) ? static_cast<long long>(entry(index).j) : 0;
  };
  constexpr Lanes kRows = {row(0), row(1), row(2), row(3)};
  constexpr Lanes kColumns = {column(0), column(1), column(2), column(3)};
  return sum_over<kTechniques>(batch, [&](const Sample&, const Four& c) {
    return __builtin_shuffle(c, kRows) * __builtin_shuffle(c, kColumns);
  });
}
template <std::size_t kTechniques, std::size_t kFour>
Four vector_part(const Batch& batch) {
  constexpr auto technique = [](std::size_t lane) -> long long {
    return static_cast<long long>((4 * kFour + lane) % kTechniques);
  };
  constexpr auto color = [](std::size_t lane) {
    return std::min((4 * kFour + lane) / kTechniques, kColors - 1);
  };
  constexpr Lanes kLanes = {technique(0), technique(1), technique(2), technique(3)};
  return sum_over<kTechniques>(batch, [&](const Sample& sample, const Four& c) {
    const Color& f = sample.f_over_q;
    return Four{f[color(0)], f[color(1)], f[color(2)], f[color(3)]} * __builtin_shuffle(c, kLanes);
  });
}

}  // namespace in_registers

// The entries of S_A, packed, and of S_b, by color and technique: those of sums_of() to the last bit, but for
// signs of zeros.
template <std::size_t kTechniques>
InFours<packed_size(kTechniques)> matrix_of(const Batch& batch) {
  InFours<packed_size(kTechniques)> a{};
  if constexpr (kTechniques <= 4) {
    [&]<std::size_t... kFour>(std::index_sequence<kFour...>) {
      (in_registers::store(in_registers::matrix_part<kTechniques, kFour>(batch), kFour, a), ...);
    }
    (std::make_index_sequence<a.size() / 4>());
  } else {
    for (std::size_t s = 0; s < kTechniques; ++s) {
      const Vector& c = batch.samples[s].c;
      for (std::size_t i = 0; i < kTechniques; ++i)
        for (std::size_t j = 0; j <= i; ++j) a[packed(i, j)] += c[i] * c[j];
    }
  }
  return a;
}
template <std::size_t kTechniques>
InFours<kColors * kTechniques> vector_of(const Batch& batch) {
  InFours<kColors * kTechniques> b{};
  if constexpr (kTechniques <= 4) {
    [&]<std::size_t... kFour>(std::index_sequence<kFour...>) {
      (in_registers::store(in_registers::vector_part<kTechniques, kFour>(batch), kFour, b), ...);
    }
    (std::make_index_sequence<b.size() / 4>());
  } else {
    for (std::size_t s = 0; s < kTechniques; ++s) {
      const Sample& sample = batch.samples[s];
      for (std::size_t k = 0; k < kColors; ++k)
        for (std::size_t i = 0; i < kTechniques; ++i)
          b[k * kTechniques + i] += sample.f_over_q[k] * sample.c[i];
    }
  }
  return b;
}

}  // namespace candela::mis
