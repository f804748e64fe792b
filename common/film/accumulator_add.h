// Adding a known number of channels to a pixel of an accumulator, four at once. For accumulator.cpp, and for
// whoever adds small arrays for each sample.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <utility>

#include "common/film/accumulator.h"
#include "common/film/quantise.h"

#if defined(__AVX__)
#include <immintrin.h>
#endif

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

// The dither words of four channels from channel kFirst on, where channel 0 has `word`.
template <std::size_t kFirst>
Words dither_words(std::uint64_t word) {
  constexpr auto left = [](std::size_t lane) { return (kFirst + lane) * kTurn % 64; };
  constexpr auto right = [](std::size_t lane) { return (64 - (kFirst + lane) * kTurn % 64) % 64; };
  constexpr Words kLeft = {left(0), left(1), left(2), left(3)};
  constexpr Words kRight = {right(0), right(1), right(2), right(3)};
  const Words all = {word, word, word, word};
  return (all << kLeft) | (all >> kRight);
}

// quantise() with dither(), of four channels. Precondition: |values| are at most kMaxFastUnits units.
// Rounding to nearest gives the floor or one more.
inline Words quantise_four(const Values& values, double units_per_value, const Words& words) {
  const Values uniform = std::bit_cast<Values>((words >> 12) | 0x3ff0000000000000ULL) - 1.0;
  const Values exact = values * units_per_value + uniform;
  const Values shifted = exact + kRounds;
  const Words nearest = std::bit_cast<Words>(shifted) - std::bit_cast<std::uint64_t>(kRounds);
  return nearest + std::bit_cast<Words>(shifted - kRounds > exact);
}

inline bool any_sign(const Words& words) {
#if defined(__AVX__)
  return _mm256_movemask_pd(std::bit_cast<__m256d>(words)) != 0;
#else
  return static_cast<std::int64_t>((words[0] | words[1]) | (words[2] | words[3])) < 0;
#endif
}

// Up to four of kCount channels, from channel kFirst on; others are zero.
template <std::size_t kCount, std::size_t kFirst>
struct Lanes {
  static constexpr std::size_t n = std::min<std::size_t>(kCount - kFirst, 4);

  static Values load(const double* v) {
    const double* const p = v + kFirst;
    if constexpr (n == 4) {
      Values values;
      std::memcpy(&values, p, sizeof values);
      return values;
    }
    return Values{p[0], n > 1 ? p[1] : 0.0, n > 2 ? p[2] : 0.0, n > 3 ? p[3] : 0.0};
  }
  static Words load(const std::int64_t* sums) {
    const auto lane = [&](std::size_t i) { return static_cast<std::uint64_t>(sums[kFirst + i]); };
    return Words{lane(0), n > 1 ? lane(1) : 0, n > 2 ? lane(2) : 0, n > 3 ? lane(3) : 0};
  }
  static void store(const Words& words, std::int64_t* sums) {
    for (std::size_t i = 0; i < n; ++i) sums[kFirst + i] = static_cast<std::int64_t>(words[i]);
  }
};

// All bits of a lane are set if its value is above the limit or NaN.
inline Words beyond(const Values& values, double limit) {
  const Values magnitude = std::bit_cast<Values>(std::bit_cast<Words>(values) & ~(1ULL << 63));
  return ~std::bit_cast<Words>(magnitude <= limit);
}

enum class Added : std::uint8_t { all, wrapped, none };

// Adds values whose magnitudes are all at most the limit, or none. `word` is the first channel's.
// kWholeFours: behind the values there are others, no larger, up to a multiple of four.
template <std::size_t kCount, bool kWholeFours = false>
Added add_if_within(std::int64_t* sums, const double* v, double limit, double units_per_value,
                    std::uint64_t word) {
  constexpr std::size_t kFours = (kCount + 3) / 4, kGiven = kWholeFours ? 4 * kFours : kCount;
  return [&]<std::size_t... kFour>(std::index_sequence<kFour...>) {
    const Values values[kFours] = {Lanes<kGiven, 4 * kFour>::load(v)...};
    const Words before[kFours] = {Lanes<kCount, 4 * kFour>::load(sums)...};
    const Words units[kFours] = {
        quantise_four(values[kFour], units_per_value, dither_words<4 * kFour>(word))...};
    const Words after[kFours] = {(before[kFour] + units[kFour])...};
    const Words outside = (beyond(values[kFour], limit) | ...);
    // The sign bit of a lane is set if its sum wrapped around.
    const Words wrapped = (((before[kFour] ^ after[kFour]) & (units[kFour] ^ after[kFour])) | ...);
    // One test for both, since both are rare.
    const bool rare = any_sign(outside | wrapped);
    if (rare && any_sign(outside)) [[unlikely]]
      return Added::none;
    (Lanes<kCount, 4 * kFour>::store(after[kFour], sums), ...);
    return rare ? Added::wrapped : Added::all;
  }
  (std::make_index_sequence<kFours>());
}

// The most channels that are added in this way.
inline constexpr std::size_t kMaxChunk = 12;

}  // namespace adding

template <std::size_t kCount>
[[gnu::always_inline]] inline bool UnitAccumulator::add_array(
    const Place& place, std::uint32_t first, const std::array<double, (kCount + 3) / 4 * 4>& values,
    std::uint64_t key, std::uint64_t word, SampleCounts& sample_counts) {
  if constexpr (kCount <= adding::kMaxChunk) {
    adding::touch(touched_[place.tile]);
    const adding::Added added = adding::add_if_within<kCount, true>(
        sums_.data() + place.pixel * spec_.channels + first, values.data(),
        limit_ * (adding::kMaxFastUnits / kMaxContribution), units_per_value_,
        std::rotl(word, static_cast<int>(first * adding::kTurn % 64)));
    if (added == adding::Added::wrapped) [[unlikely]]
      overflowed_.store(true, std::memory_order_relaxed);
    if (added != adding::Added::none) [[likely]]
      return true;
  }
  return add(place.x, place.y, first, std::span(values).template first<kCount>(), key, sample_counts);
}

}  // namespace candela::film
