// Adding a known number of channels to a pixel of an accumulator, four at once. For accumulator.cpp, and for
// whoever adds small arrays for each sample.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "common/film/accumulator.h"
#include "common/film/quantise.h"

namespace candela::film {
namespace adding {

inline void touch(std::uint8_t& flag) {
  if (__atomic_load_n(&flag, __ATOMIC_RELAXED) == 0)
    __atomic_store_n(&flag, std::uint8_t{1}, __ATOMIC_RELAXED);
}

// Four channels at once. An entry of a comparison is -1 where it holds, else 0.
using Values = double __attribute__((vector_size(32)));
using Words = std::uint64_t __attribute__((vector_size(32)));

// Up to so many units floor() follows from an addition that rounds to integers.
inline constexpr double kMaxFastUnits = 0x1p50;
inline constexpr double kRounds = 0x1.8p52;
inline constexpr int kTurn = 21;  // of a dither word, from one channel to the next

// quantise() with dither(), of four channels from the word's own on. Precondition: |values| are at most
// kMaxFastUnits units. Rounding to nearest gives the floor or one more.
inline Words quantise_four(const Values& values, double units_per_value, std::uint64_t word) {
  const Words words = {word, std::rotl(word, kTurn), std::rotl(word, 2 * kTurn), std::rotl(word, 3 * kTurn)};
  const Values uniform = std::bit_cast<Values>((words >> 12) | 0x3ff0000000000000ULL) - 1.0;
  const Values exact = values * units_per_value + uniform;
  const Values shifted = exact + kRounds;
  const Words nearest = std::bit_cast<Words>(shifted) - std::bit_cast<std::uint64_t>(kRounds);
  return nearest + std::bit_cast<Words>(shifted - kRounds > exact);
}

// A few channels whose number is known.
template <std::size_t kCount>
struct Chunk {
  // Whether all |v| are at most the limit; NaN is not.
  static bool within(const double* v, double limit) {
    bool all = true;
    for (std::size_t i = 0; i < kCount; ++i) all &= std::abs(v[i]) <= limit;
    return all;
  }
  // Whether a sum wrapped around.
  static bool add(std::int64_t* sums, const double* v, double units_per_value, std::uint64_t word) {
    constexpr std::size_t n = kCount;
    const Values four = {v[0], n > 1 ? v[1] : 0.0, n > 2 ? v[2] : 0.0, n > 3 ? v[3] : 0.0};
    const Words units = quantise_four(four, units_per_value, word);
    bool wrapped = false;
    for (std::size_t i = 0; i < std::min<std::size_t>(n, 4); ++i)
      wrapped |= __builtin_add_overflow(sums[i], static_cast<std::int64_t>(units[i]), &sums[i]);
    if constexpr (n > 4)
      wrapped |= Chunk<n - 4>::add(sums + 4, v + 4, units_per_value, std::rotl(word, 4 * kTurn));
    return wrapped;
  }
};

enum class Added : std::uint8_t { all, wrapped, none };

// Adds values that are all within the limit, or none.
template <std::size_t kCount>
Added add_if_within(std::int64_t* sums, const double* v, double limit, double units_per_value,
                    std::uint64_t word) {
  if (!Chunk<kCount>::within(v, limit)) [[unlikely]]
    return Added::none;
  return Chunk<kCount>::add(sums, v, units_per_value, word) ? Added::wrapped : Added::all;
}

// The most channels that are added in this way.
inline constexpr std::size_t kMaxChunk = 12;

}  // namespace adding

template <std::size_t kCount>
bool UnitAccumulator::add_array(std::uint32_t x, std::uint32_t y, std::uint32_t first,
                                const std::array<double, kCount>& values, std::uint64_t key,
                                std::uint64_t word, Tallies& tallies) {
  if constexpr (kCount <= adding::kMaxChunk) {
    adding::touch(touched_[std::size_t{y / kTileSize} * layout_.tiles_x() + x / kTileSize]);
    const adding::Added added = adding::add_if_within<kCount>(
        sums_.data() + (std::size_t{y} * layout_.width + x) * spec_.channels + first, values.data(),
        limit_ * (adding::kMaxFastUnits / kMaxContribution), units_per_value_,
        std::rotl(word, static_cast<int>(first * adding::kTurn % 64)));
    if (added == adding::Added::wrapped) [[unlikely]]
      overflowed_.store(true, std::memory_order_relaxed);
    if (added != adding::Added::none) [[likely]]
      return true;
  }
  return add(x, y, first, values, key, tallies);
}

}  // namespace candela::film
