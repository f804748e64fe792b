// Sums beside the film: per pixel a fixed number of 64-bit integers with a scale of their own, for statistics
// that are no radiance (sectors of a neighborhood, moments, matrices). They are quantized once, add exactly,
// and travel and are stored beside the film's sums.
#pragma once

#include <array>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/film/counts.h"
#include "common/film/layout.h"
#include "common/film/tile_sums.h"

namespace candela::film {

inline constexpr std::uint32_t kMaxAccumulators = 24;
inline constexpr std::uint32_t kMaxAccumulatorChannels = 96;
// Limit of pixels times channels over all accumulators: as many integers as the largest film has.
inline constexpr std::uint64_t kMaxAccumulatorValues = kMaxLayerPixels * kChannels;

struct AccumulatorSpec {
  enum class Per : std::uint8_t {
    job,    // one for each half of the job
    epoch,  // one for each epoch, of both halves together
  };
  std::string name;  // as a layer's: "radius.sectors"
  std::uint32_t channels = 1;
  int scale_log2 = 0;  // an integer is value * 2^scale_log2
  Per per = Per::job;
  bool operator==(const AccumulatorSpec&) const = default;
};

// Fails (input) unless names are valid as layers' names are and all different, and channels, scales, their
// number and their size together are within the bounds above. The error's field begins with "accumulators".
Result<void> validate(std::span<const AccumulatorSpec> specs, std::uint32_t width, std::uint32_t height);

// The accumulator that a worker adds the samples of one unit into.
class UnitAccumulator {
 public:
  // Precondition: validate() holds.
  UnitAccumulator(std::uint32_t width, std::uint32_t height, const AccumulatorSpec& spec);

  const AccumulatorSpec& spec() const { return spec_; }

  // Adds values to channels [first, first + values.size()) of a pixel that only the calling thread touches.
  // Signs are free. `key` names the sample and seeds the rounding; two calls for one pixel must differ in
  // key or in channels. If any value is NaN, infinite or saturated, none is added, the sample counts once in
  // `tallies.rejected`, and the result is false. Preconditions: pixel and channels are inside.
  bool add(std::uint32_t x, std::uint32_t y, std::uint32_t first, std::span<const double> values,
           std::uint64_t key, Tallies& tallies);
  // A pixel. It is the same for all accumulators of one size.
  struct Place {
    std::uint32_t x = 0, y = 0;
    std::size_t pixel = 0, tile = 0;  // indices
  };
  Place place(std::uint32_t x, std::uint32_t y) const {
    return {x, y, std::size_t{y} * layout_.width + x,
            std::size_t{y / kTileSize} * layout_.tiles_x() + x / kTileSize};
  }
  // add() of a number of values that the compiler knows, the first kCount of an array of whole fours; those
  // beyond are no larger. word: dither_word(key), which accumulators of one sample share. Defined in
  // accumulator_add.h.
  template <std::size_t kCount>
  bool add_array(const Place& place, std::uint32_t first,
                 const std::array<double, (kCount + 3) / 4 * 4>& values, std::uint64_t key,
                 std::uint64_t word, Tallies& tallies);
  // The same from any thread. Not at the same time as add() on the same pixel.
  bool splat(std::uint32_t x, std::uint32_t y, std::uint32_t first, std::span<const double> values,
             std::uint64_t key, Tallies& tallies);

  // True if add() and splat() take these values.
  bool holds(std::span<const double> values) const {
    bool all = true;
    for (const double value : values) all &= std::abs(value) <= limit_;  // false for NaN
    return all;
  }
  // A sum wrapped around: the unit must fail.
  bool overflowed() const { return overflowed_.load(std::memory_order_relaxed); }
  void clear();

  // Index: (y * width + x) * channels + channel.
  const std::int64_t* sums() const { return sums_.data(); }
  // Appends the sums in the form of a delta (sparse_sums.h).
  void put_sums(std::string& out) const;

 private:
  template <class ToSum>
  bool add_units(std::uint32_t x, std::uint32_t y, std::uint32_t first, std::span<const double> values,
                 std::uint64_t key, Tallies& tallies, const ToSum& to_sum);

  AccumulatorSpec spec_;
  Layout layout_;  // one layer
  double units_per_value_;
  double limit_;  // the largest value that is not saturated
  std::vector<std::int64_t> sums_;
  std::vector<std::uint8_t> touched_;  // by tile; relaxed atomic access while threads add
  std::atomic<bool> overflowed_{false};
};

// The accumulator that a master adds up. Sums are exact: 64 bits, widened to 128 where 64 would overflow, so
// merging never fails for what the sums are, and is commutative and associative. Which units are in it, the
// job's film knows (law 3).
class MergedAccumulator {
 public:
  // Precondition: validate() holds.
  MergedAccumulator(std::uint32_t width, std::uint32_t height, const AccumulatorSpec& spec);

  const AccumulatorSpec& spec() const { return spec_; }
  // Preconditions and memory of these are those of TileSums.
  void merge(const SparseSums& sums) { sums_.add(sums); }
  void reserve(const SparseSums& sums) { sums_.reserve(sums); }
  void take_back(const SparseSums& sums, SparseSums::TileBuffers& buffers) { sums_.subtract(sums, buffers); }
  // Fails (refused), and nothing changes, if size or spec differ.
  Result<void> merge(const MergedAccumulator& other);

  Int128 sum(std::uint32_t x, std::uint32_t y, std::uint32_t channel) const {
    return sums_.sum(0, x, y, channel);
  }
  // All channels of a pixel at once. Precondition: `sums` has one for each channel.
  void get_pixel(std::uint32_t x, std::uint32_t y, std::span<Int128> sums) const {
    sums_.get_pixel(0, x, y, sums);
  }
  void set_pixel(std::uint32_t x, std::uint32_t y, std::span<const Int128> sums) {
    sums_.set_pixel(0, x, y, sums);
  }
  std::uint32_t width() const { return layout_.width; }
  std::uint32_t height() const { return layout_.height; }
  std::uint64_t memory_bytes() const { return sums_.memory_bytes(); }

  // Stored form: width, height, channels, scale (u32 each), and the sums (TileSums::put). Equal sums give
  // equal bytes.
  std::string serialise() const;
  // Fails (input) on anything but the whole of what serialise() of such an accumulator makes.
  static Result<MergedAccumulator> parse(std::string_view bytes, std::uint32_t width, std::uint32_t height,
                                         const AccumulatorSpec& spec);

 private:
  AccumulatorSpec spec_;
  Layout layout_;  // one layer
  TileSums sums_;
};

}  // namespace candela::film
