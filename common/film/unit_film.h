// The film that a worker adds the samples of one unit into: exact integer sums (quantise.h).
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cstdint>
#include <string>
#include <vector>

#include "common/film/counts.h"
#include "common/film/layout.h"
#include "common/film/quantise.h"

namespace candela::film {

// The accumulator of one unit. Sized for the whole film; touched tiles are known.
class UnitFilm {
 public:
  // Precondition: validate(layout, scale_log2).
  UnitFilm(Layout layout, int scale_log2);

  const Layout& layout() const { return layout_; }
  int scale_log2() const { return scale_log2_; }

  // Preconditions of add and splat: layer, x and y are inside the layout (not checked: the innermost loop).
  //
  // Adds one sample's r, g, b to a pixel that only the calling thread touches (eye paths: threads own tiles).
  // `key` names the sample (seed, iteration, pixel, ...) and seeds the rounding. A value that is NaN,
  // infinite, saturated, or negative where `signed_values` is false counts in `sample_counts.rejected` and
  // leaves the film alone, all channels of it. One sample counts once, as the first of nan, infinite,
  // negative, saturated that any channel has. Returns false if it was rejected. Counts no eye_samples: that
  // is the caller's.
  bool add(std::uint32_t layer, std::uint32_t x, std::uint32_t y, const std::array<float, kChannels>& rgb,
           std::uint64_t key, SampleCounts& sample_counts, bool signed_values = false);

  // The same from any thread (light paths): relaxed atomic adds. Not at the same time as add() on the same
  // pixel.
  bool splat(std::uint32_t layer, std::uint32_t x, std::uint32_t y, const std::array<float, kChannels>& rgb,
             std::uint64_t key, SampleCounts& sample_counts, bool signed_values = false);

  // The units that add() and splat() take of such a value with the key of this word (dither_word(key)).
  // Precondition: they do not reject it.
  std::array<std::int64_t, kChannels> units(const std::array<float, kChannels>& rgb,
                                            std::uint64_t word) const {
    std::array<std::int64_t, kChannels> result;
    for (std::size_t c = 0; c < kChannels; ++c)
      result[c] = quantise(rgb[c], units_per_value_, dither(word, static_cast<int>(c)));
    return result;
  }
  // Adds units, from any thread: of a layer that has a part of the image's contributions.
  void splat_units(std::uint32_t layer, std::uint32_t x, std::uint32_t y,
                   const std::array<std::int64_t, kChannels>& units);
  // A sum of such units wrapped around on its way to the film.
  void note_overflow() { overflowed_.store(true, std::memory_order_relaxed); }

  // Threads count on their own and hand in their counts when they are done. Thread-safe.
  void count(const SampleCounts& sample_counts);
  SampleCounts sample_counts() const;

  // True if any sum wrapped around: the unit must fail, its film must not be delivered.
  bool overflowed() const { return overflowed_.load(std::memory_order_relaxed); }

  // Ready for the next unit, memory kept.
  void clear();

  // Sum of a pixel in film units, for tests and encoders. Index: (layer * height + y) * width + x.
  const std::int64_t* sums() const { return sums_.data(); }
  bool touched(std::size_t tile_index) const { return touched_[tile_index] != 0; }
  // Appends the sums in the form of a delta (sparse_sums.h).
  void put_sums(std::string& out) const;

 private:
  // True for what may be added. Otherwise counts the cause. Out of line: the unusual case.
  bool admit(const std::array<float, kChannels>& rgb, SampleCounts& sample_counts, bool signed_values) const;
  bool usual(const std::array<float, kChannels>& rgb, bool signed_values) const {
    // As integers, the bits of floats from +0 to the limit are below those of larger ones, infinities, NaNs
    // and all that has its sign set: one comparison decides.
    const std::uint32_t mask = signed_values ? 0x7fffffffU : 0xffffffffU;
    const std::uint32_t r = std::bit_cast<std::uint32_t>(rgb[0]) & mask;
    const std::uint32_t g = std::bit_cast<std::uint32_t>(rgb[1]) & mask;
    const std::uint32_t b = std::bit_cast<std::uint32_t>(rgb[2]) & mask;
    return std::max(std::max(r, g), b) <= limit_bits_;
  }
  void mark(std::uint32_t layer, std::uint32_t x, std::uint32_t y) {
    std::uint8_t& flag = touched_[(std::size_t{layer} * tiles_y_ + y / kTileSize) * tiles_x_ + x / kTileSize];
    // Read first: a store each time would pass the cache line around between threads.
    if (__atomic_load_n(&flag, __ATOMIC_RELAXED) == 0)
      __atomic_store_n(&flag, std::uint8_t{1}, __ATOMIC_RELAXED);
  }
  // Shared by add() and splat(); `to_sum(sum, units)` adds and returns whether the sum wrapped around.
  template <class ToSum>
  bool add_units(std::uint32_t layer, std::uint32_t x, std::uint32_t y,
                 const std::array<float, kChannels>& rgb, std::uint64_t key, SampleCounts& sample_counts,
                 bool signed_values, const ToSum& to_sum);
  std::int64_t* pixel(std::uint32_t layer, std::uint32_t x, std::uint32_t y) {
    return sums_.data() + ((std::size_t{layer} * layout_.height + y) * layout_.width + x) * kChannels;
  }

  Layout layout_;
  int scale_log2_;
  double units_per_value_;
  std::uint32_t limit_bits_;  // of the largest float that is not saturated
  std::uint32_t tiles_x_, tiles_y_;
  std::vector<std::int64_t> sums_;     // [layer][y][x][channel]
  std::vector<std::uint8_t> touched_;  // [layer][tile]; relaxed atomic access while threads add
  std::atomic<bool> overflowed_{false};
  mutable std::atomic_flag lock_ = ATOMIC_FLAG_INIT;
  SampleCounts sample_counts_;
};

template <class ToSum>
inline bool UnitFilm::add_units(std::uint32_t layer, std::uint32_t x, std::uint32_t y,
                                const std::array<float, kChannels>& rgb, std::uint64_t key,
                                SampleCounts& sample_counts, bool signed_values, const ToSum& to_sum) {
  if (!usual(rgb, signed_values)) [[unlikely]] {
    if (!admit(rgb, sample_counts, signed_values)) return false;
  }
  mark(layer, x, y);
  std::int64_t* sums = pixel(layer, x, y);
  const std::uint64_t word = dither_word(key);
  bool wrapped = false;
  for (int c = 0; c < kChannels; ++c) {
    const std::int64_t units = quantise(rgb[static_cast<std::size_t>(c)], units_per_value_, dither(word, c));
    wrapped |= to_sum(sums[c], units);
  }
  if (wrapped) [[unlikely]]
    overflowed_.store(true, std::memory_order_relaxed);
  return true;
}

inline bool UnitFilm::add(std::uint32_t layer, std::uint32_t x, std::uint32_t y,
                          const std::array<float, kChannels>& rgb, std::uint64_t key,
                          SampleCounts& sample_counts, bool signed_values) {
  return add_units(
      layer, x, y, rgb, key, sample_counts, signed_values,
      [](std::int64_t& sum, std::int64_t units) { return __builtin_add_overflow(sum, units, &sum); });
}

inline bool UnitFilm::splat(std::uint32_t layer, std::uint32_t x, std::uint32_t y,
                            const std::array<float, kChannels>& rgb, std::uint64_t key,
                            SampleCounts& sample_counts, bool signed_values) {
  return add_units(layer, x, y, rgb, key, sample_counts, signed_values,
                   [](std::int64_t& sum, std::int64_t units) {
                     const std::int64_t before = __atomic_fetch_add(&sum, units, __ATOMIC_RELAXED);
                     std::int64_t after = 0;
                     return __builtin_add_overflow(before, units, &after);
                   });
}

inline void UnitFilm::splat_units(std::uint32_t layer, std::uint32_t x, std::uint32_t y,
                                  const std::array<std::int64_t, kChannels>& units) {
  mark(layer, x, y);
  std::int64_t* sums = pixel(layer, x, y);
  bool wrapped = false;
  for (std::size_t c = 0; c < kChannels; ++c) {
    const std::int64_t before = __atomic_fetch_add(&sums[c], units[c], __ATOMIC_RELAXED);
    std::int64_t after = 0;
    wrapped |= __builtin_add_overflow(before, units[c], &after);
  }
  if (wrapped) [[unlikely]]
    note_overflow();
}

}  // namespace candela::film
