// Sums beside the film: 64-bit integers with a scale of their own, for statistics that are no radiance
// (sectors of a neighborhood, moments, matrices). They are quantized once, add exactly, and travel and are
// stored beside the film's sums. Their domain is the film, a table, or pixels with keys (keyed_sums.h).
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
#include "common/film/keyed_sums.h"
#include "common/film/layout.h"
#include "common/film/sparse_sums.h"
#include "common/film/tile_sums.h"

namespace candela::film {

inline constexpr std::uint32_t kMaxAccumulators = 24;
inline constexpr std::uint32_t kMaxAccumulatorChannels = 96;
inline constexpr std::uint32_t kMaxTableEntries = 1U << 24;
inline constexpr std::uint64_t kMaxPixelKeys =
    8;  // in the mean of a film's pixels, for which there is memory
inline constexpr std::uint64_t kMaxKeyNameBytes = 1ULL << 20;  // of all keys of an accumulator together
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
  enum class Domain : std::uint8_t {
    film,   // each pixel has `channels` sums
    table,  // each of `entries` has; they have nothing to do with pixels
    keys,   // each pair of a pixel and a key that was added has one
  };
  Domain domain = Domain::film;
  std::uint32_t entries = 0;                // of a table
  std::vector<std::string> key_names = {};  // a key is an index here
  bool operator==(const AccumulatorSpec&) const = default;
};

// The grid of a dense accumulator's sums: the film, or the entries of a table, kTableRow in a row.
inline constexpr std::uint32_t kTableRow = 1024;
Layout grid_of(const AccumulatorSpec& spec, std::uint32_t width, std::uint32_t height);
struct TablePlace {
  std::uint32_t x, y;
};
constexpr TablePlace place_of_entry(std::uint32_t entry) {
  return {entry % kTableRow, entry / kTableRow};
}
// Limit of pairs of pixel and key, in a unit and in a half of the job. Beyond it the job ends.
std::uint64_t max_pairs(const AccumulatorSpec& spec, std::uint32_t width, std::uint32_t height);
// Memory of the sums of one half or epoch if all places have one.
std::uint64_t sums_bytes(const AccumulatorSpec& spec, std::uint32_t width, std::uint32_t height);

// Fails (input) unless names are valid as layers' names are and all different, and channels, scales, domains,
// their number and their size together are within the bounds above. The error's field begins with
// "accumulators".
Result<void> validate(std::span<const AccumulatorSpec> specs, std::uint32_t width, std::uint32_t height);

// The accumulator that a worker adds the samples of one unit into.
class UnitAccumulator {
 public:
  // Precondition: validate() holds.
  UnitAccumulator(std::uint32_t width, std::uint32_t height, const AccumulatorSpec& spec);

  const AccumulatorSpec& spec() const { return spec_; }

  // Adds values to channels [first, first + values.size()) of a pixel (of the grid, grid_of()) that only the
  // calling thread touches. Signs are free. `key` names the sample and seeds the rounding; two calls for one
  // pixel must differ in key or in channels. If any value is NaN, infinite or saturated, none is added, the
  // sample counts once in `sample_counts.rejected`, and the result is false. Preconditions: pixel and
  // channels are inside.
  bool add(std::uint32_t x, std::uint32_t y, std::uint32_t first, std::span<const double> values,
           std::uint64_t key, SampleCounts& sample_counts);
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
                 std::uint64_t word, SampleCounts& sample_counts);
  // The same from any thread. Not at the same time as add() on the same pixel.
  bool splat(std::uint32_t x, std::uint32_t y, std::uint32_t first, std::span<const double> values,
             std::uint64_t key, SampleCounts& sample_counts);

  // The same of a pixel and a key, from any thread. Precondition: the domain is keys.
  bool add_key(std::uint32_t x, std::uint32_t y, std::uint32_t key, double value, std::uint64_t sample_key,
               SampleCounts& sample_counts);

  // True if add() and splat() take these values.
  bool holds(std::span<const double> values) const {
    bool all = true;
    for (const double value : values) all &= std::abs(value) <= limit_;  // false for NaN
    return all;
  }
  // A sum wrapped around: the unit must fail.
  bool overflowed() const { return overflowed_.load(std::memory_order_relaxed); }
  // More pairs of pixel and key than max_pairs(): the unit must fail.
  bool overfull() const;
  void clear();

  // Index: (y * width + x) * channels + channel, of the grid.
  const std::int64_t* sums() const { return sums_.data(); }
  // The sums of keys.
  KeyedSums keys() const { return keys_.sums(); }
  // Appends the sums in the form of a delta (sparse_sums.h, keyed_sums.h).
  void put_sums(std::string& out) const;

 private:
  template <class ToSum>
  bool add_units(std::uint32_t x, std::uint32_t y, std::uint32_t first, std::span<const double> values,
                 std::uint64_t key, SampleCounts& sample_counts, const ToSum& to_sum);

  AccumulatorSpec spec_;
  Layout layout_;  // one layer: the grid; of keys the film
  std::uint64_t max_pairs_ = 0;
  double units_per_value_;
  double limit_;  // the largest value that is not saturated
  std::vector<std::int64_t> sums_;
  std::vector<std::uint8_t> touched_;  // by tile; relaxed atomic access while threads add
  std::atomic<bool> overflowed_{false};
  UnitKeys keys_;
};

// The sums of an accumulator as a delta brings them: of keys `keys`, else `sums`.
struct BroughtSums {
  std::uint64_t epoch = 0;
  SparseSums sums;
  KeyedSums keys = {};
  bool keyed() const { return keys.has_tiles(); }
};

// The accumulator that a master adds up. Sums are exact: 64 bits, widened to 128 where 64 would overflow, so
// merging never fails for what the sums are, and is commutative and associative. Which units are in it, the
// job's film knows (law 3).
class MergedAccumulator {
 public:
  // Precondition: validate() holds.
  MergedAccumulator(std::uint32_t width, std::uint32_t height, const AccumulatorSpec& spec);

  const AccumulatorSpec& spec() const { return spec_; }
  // Preconditions and memory of these are those of TileSums and KeyedSums.
  void merge(const SparseSums& sums) { sums_.add(sums); }
  void merge(const BroughtSums& brought) { keyed() ? keys_.add(brought.keys) : sums_.add(brought.sums); }
  void reserve(const BroughtSums& brought) {
    keyed() ? keys_.reserve(brought.keys) : sums_.reserve(brought.sums);
  }
  void take_back(const BroughtSums& brought, SparseSums::TileBuffers& buffers) {
    keyed() ? keys_.subtract(brought.keys) : sums_.subtract(brought.sums, buffers);
  }
  // With the brought sums there were more pairs of pixel and key than max_pairs().
  bool overfull_with(const BroughtSums& brought) const {
    return keyed() && keys_.pairs_with(brought.keys) > max_pairs(spec_, layout_.width, layout_.height);
  }
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
  // The sums of keys. Empty in another domain.
  const KeyedSums& keys() const { return keys_; }
  // The size of the grid; that of the film for keys.
  std::uint32_t width() const { return layout_.width; }
  std::uint32_t height() const { return layout_.height; }
  std::uint64_t memory_bytes() const { return keyed() ? keys_.memory_bytes() : sums_.memory_bytes(); }

  // Stored form: width, height, channels, scale (u32 each), and the sums (TileSums::put, KeyedSums::put).
  // Equal sums give equal bytes. `width` and `height` are the film's.
  std::string serialise() const;
  // Fails (input) on anything but the whole of what serialise() of such an accumulator makes.
  static Result<MergedAccumulator> parse(std::string_view bytes, std::uint32_t width, std::uint32_t height,
                                         const AccumulatorSpec& spec);

 private:
  bool keyed() const { return spec_.domain == AccumulatorSpec::Domain::keys; }

  AccumulatorSpec spec_;
  Layout layout_;  // one layer: the grid; of keys the film
  TileSums sums_;
  KeyedSums keys_;
};

}  // namespace candela::film
