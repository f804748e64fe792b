// Exact film tallies. Every contribution is quantised once to an integer with the job's scale; integers add
// the same in any order, so merging is commutative and associative, and idempotence comes from the set of
// merged iterations kept beside the sums (law 3).
//
// Rounding is stochastic and unbiased: floor(value * 2^log2 + u), u uniform in [0,1) from a hash of the
// sample's key, so E[tally] = value * 2^log2 exactly, however small the value, and the result depends on the
// sample alone.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/result.h"
#include "common/job/job.h"
#include "common/rng/stream.h"

namespace candela::film {

inline constexpr int kTileSize =
    32;  // pixels a side; the unit of sparseness in deltas and of width in merged films
inline constexpr int kChannels = 3;  // linear Rec.709 R, G, B

__extension__ using Int128 = __int128;  // a GCC extension that -Wpedantic wants declared

struct Layout {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::uint32_t layers = 1;  // layer 0 is the image
  bool operator==(const Layout&) const = default;
  std::size_t pixel_count() const { return std::size_t{width} * height; }
  std::uint32_t tiles_x() const { return (width + kTileSize - 1) / kTileSize; }
  std::uint32_t tiles_y() const { return (height + kTileSize - 1) / kTileSize; }
  std::size_t tile_count() const { return std::size_t{tiles_x()} * tiles_y() * layers; }
};

// Bounds of what a film may be. A quantity of 2^-200 to 2^200 a unit covers every float and its square.
inline constexpr int kMaxScaleLog2 = 200;
inline constexpr std::uint32_t kMaxLayers = 64;
inline constexpr std::uint64_t kMaxLayerPixels = 1ULL << 30;  // width * height * layers
// Fails (input) unless layout and scale are within Limits and the bounds above. The constructors of films
// require it.
Result<void> validate(const Layout& layout, int scale_log2);
// A scale for an image whose mean luminance is about this, > 0: the mean becomes 2^19 to 2^20 film units.
// Rounding noise of one unit is then about 2^-20 of the mean, far below any sample's noise, and one sample
// may still be 2^36 times the mean before it counts as saturated.
int scale_log2_for(double mean_luminance);

// The pixels of one tile, cut at the film's border. Index: (layer * tiles_y + tile_y) * tiles_x + tile_x.
struct TileRect {
  std::uint32_t layer, x, y, width, height;
  std::uint32_t pixels() const { return width * height; }
};
TileRect tile_rect(const Layout& layout, std::size_t tile_index);

// Why a sample was kept out of the film.
enum class RejectCause : std::uint8_t { not_a_number, infinite, negative, saturated };
inline constexpr int kRejectCauses = 4;
std::string_view name(RejectCause cause);  // "nan", "infinite", "negative", "saturated"

// Additive counts that travel with the sums.
struct Tallies {
  std::uint64_t eye_samples = 0;
  std::uint64_t light_paths = 0;
  std::uint64_t rays = 0;
  std::array<std::uint64_t, kRejectCauses> rejected{};
  void add(const Tallies& other);
  bool operator==(const Tallies&) const = default;
};

// One contribution may be at most this many film units; beyond it is `saturated`.
inline constexpr double kMaxContribution = 0x1p56;

// Three numbers uniform in [0, 1) of 52 bits each from a sample's key. The word is not one that rng::Stream
// draws from the same key: a dither that depended on the sampled path would bias the rounding. The channels
// share the word, which correlates their rounding errors (each below one film unit) and biases none.
inline double dither(std::uint64_t word, int channel) {
  const std::uint64_t bits = std::rotl(word, 21 * channel);
  return std::bit_cast<double>((bits >> 12) | 0x3ff0000000000000ULL) - 1.0;
}
inline std::uint64_t dither_word(std::uint64_t key) {
  return rng::mix64(key ^ 0xd1b54a32d192ed03ULL);
}

// Quantises a finite value (negative allowed: filters with lobes). `uniform` is in [0, 1).
inline std::int64_t quantise(double value, double units_per_value, double uniform) {
  return static_cast<std::int64_t>(std::floor(value * units_per_value + uniform));
}

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
  // infinite, saturated, or negative where `signed_values` is false counts in `tallies.rejected` and leaves
  // the film alone, all channels of it. One sample counts once, as the first of nan, infinite, negative,
  // saturated that any channel has. Returns false if it was rejected. Counts no eye_samples: that is the
  // caller's.
  bool add(std::uint32_t layer, std::uint32_t x, std::uint32_t y, const std::array<float, kChannels>& rgb,
           std::uint64_t key, Tallies& tallies, bool signed_values = false);

  // The same from any thread (light paths): relaxed atomic adds. Not at the same time as add() on the same
  // pixel.
  bool splat(std::uint32_t layer, std::uint32_t x, std::uint32_t y, const std::array<float, kChannels>& rgb,
             std::uint64_t key, Tallies& tallies, bool signed_values = false);

  // Threads count on their own and hand in their counts when they are done. Thread-safe.
  void count(const Tallies& tallies);
  Tallies tallies() const;

  // True if any sum wrapped around: the unit must fail, its film must not be delivered.
  bool overflowed() const { return overflowed_.load(std::memory_order_relaxed); }

  // Ready for the next unit, memory kept.
  void clear();

  // Sum of a pixel in film units, for tests and encoders. Index: (layer * height + y) * width + x.
  const std::int64_t* sums() const { return sums_.data(); }
  bool touched(std::size_t tile_index) const { return touched_[tile_index] != 0; }

 private:
  // True for what may be added. Otherwise counts the cause. Out of line: the unusual case.
  bool admit(const std::array<float, kChannels>& rgb, Tallies& tallies, bool signed_values) const;
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
  Tallies tallies_;
};

inline bool UnitFilm::add(std::uint32_t layer, std::uint32_t x, std::uint32_t y,
                          const std::array<float, kChannels>& rgb, std::uint64_t key, Tallies& tallies,
                          bool signed_values) {
  if (!usual(rgb, signed_values)) [[unlikely]] {
    if (!admit(rgb, tallies, signed_values)) return false;
  }
  mark(layer, x, y);
  std::int64_t* sums = pixel(layer, x, y);
  const std::uint64_t word = dither_word(key);
  bool wrapped = false;
  for (int c = 0; c < kChannels; ++c) {
    const std::int64_t units = quantise(rgb[static_cast<std::size_t>(c)], units_per_value_, dither(word, c));
    wrapped |= __builtin_add_overflow(sums[c], units, &sums[c]);
  }
  if (wrapped) [[unlikely]]
    overflowed_.store(true, std::memory_order_relaxed);
  return true;
}

inline bool UnitFilm::splat(std::uint32_t layer, std::uint32_t x, std::uint32_t y,
                            const std::array<float, kChannels>& rgb, std::uint64_t key, Tallies& tallies,
                            bool signed_values) {
  if (!usual(rgb, signed_values)) [[unlikely]] {
    if (!admit(rgb, tallies, signed_values)) return false;
  }
  mark(layer, x, y);
  std::int64_t* sums = pixel(layer, x, y);
  const std::uint64_t word = dither_word(key);
  bool wrapped = false;
  for (int c = 0; c < kChannels; ++c) {
    const std::int64_t units = quantise(rgb[static_cast<std::size_t>(c)], units_per_value_, dither(word, c));
    const std::int64_t before = __atomic_fetch_add(&sums[c], units, __ATOMIC_RELAXED);
    std::int64_t after = 0;
    wrapped |= __builtin_add_overflow(before, units, &after);
  }
  if (wrapped) [[unlikely]]
    overflowed_.store(true, std::memory_order_relaxed);
  return true;
}

// Disjoint sorted half-open ranges of sequence indices.
class IndexSet {
 public:
  // Adds [begin, end). False, and nothing changed, if it is empty or overlaps what is there.
  bool insert(std::uint64_t begin, std::uint64_t end);
  bool intersects(std::uint64_t begin, std::uint64_t end) const;
  std::uint64_t count() const;
  // The first gap at or after `from`, cut to `limit`: {begin, end}, empty (begin == end) if there is none
  // below limit.
  std::pair<std::uint64_t, std::uint64_t> first_gap(std::uint64_t from, std::uint64_t limit) const;
  const std::map<std::uint64_t, std::uint64_t>& ranges() const { return ranges_; }  // begin -> end
  bool operator==(const IndexSet&) const = default;

 private:
  std::map<std::uint64_t, std::uint64_t> ranges_;
};

// What identifies a delta: checked against the lease before it is merged.
struct DeltaInfo {
  Unit unit;
  Layout layout;
  int scale_log2 = 0;
  std::string job_id;
  std::string build_id;
};

// One channel of a group of tiles as byte planes: plane p holds byte p of each zigzag integer. Planes of
// zeros are absent.
struct PlaneSet {
  static constexpr int kMaxPlanes = 16;
  std::size_t values = 0;
  std::uint32_t present = 0;  // bit p: plane p is in `bytes`, lowest first, `values` bytes each
  std::shared_ptr<const std::uint8_t[]> bytes;
};

// Wire form of a unit's film: header, tallies, touched tiles compressed (byte planes of zigzag integers,
// zstd), checksum. Deterministic: films of equal sums and tallies give equal bytes. Preconditions: the film
// has not overflowed; the ids have at most Limits::max_name_bytes; info's layout and scale are ignored in
// favour of the film's.
std::string encode_delta(const UnitFilm& film, const DeltaInfo& info);

// A checked, decoded delta.
class Delta {
 public:
  // Fails on anything that is not the whole and unchanged output of encode_delta: wrong magic, length,
  // checksum, tile index, decompressed size, trailing bytes. Memory is bounded by the layout in `expected`,
  // which must match.
  static Result<Delta> decode(std::string_view bytes, const Layout& expected);
  const DeltaInfo& info() const { return info_; }
  const Tallies& tallies() const { return tallies_; }

 private:
  friend class MergedFilm;
  // Consecutive entries of tiles_, kept as byte planes (a third of the memory of the sums) until they are
  // merged.
  struct Group {
    std::size_t first = 0, count = 0;
    std::array<PlaneSet, kChannels> channels;
  };
  DeltaInfo info_;
  Tallies tallies_;
  std::vector<std::uint32_t> tiles_;  // ascending indices
  std::vector<Group> groups_;
};

// The job's film: two halves, each exact sums, tallies, and the set of merged indices.
class MergedFilm {
 public:
  // Precondition: validate(layout, scale_log2).
  MergedFilm(Layout layout, int scale_log2);

  const Layout& layout() const { return layout_; }
  int scale_log2() const { return scale_log2_; }

  // Adds a delta of iterations or segments. Refused, and nothing changed, if its layout or scale differ or
  // any of its indices is merged already.
  Result<void> merge(const Delta& delta);
  // Adds another film of the same job (a relay's, or a shard's) under the same rules.
  Result<void> merge(const MergedFilm& other);

  const IndexSet& merged(std::uint32_t half) const { return halves_[half].merged; }
  const Tallies& tallies(std::uint32_t half) const { return halves_[half].tallies; }
  std::uint64_t iterations() const { return halves_[0].merged.count() + halves_[1].merged.count(); }

  // Checkpoint form: everything above, compressed, with a checksum. parse() accepts exactly what serialise()
  // makes.
  std::string serialise() const;
  static Result<MergedFilm> parse(std::string_view bytes);

  // A copy of the first layers alone, with the tallies and the merged indices.
  MergedFilm first_layers(std::uint32_t count) const;
  MergedFilm image_layer() const { return first_layers(1); }

  // No sum of the first layers differs from zero.
  bool black(std::uint32_t layers) const;

  // Sum of one half in film units (128 bits).
  Int128 sum(std::uint32_t half, std::uint32_t layer, std::uint32_t x, std::uint32_t y, int channel) const;

  // Mean over iterations of one layer, both halves together or one of them: width * height * 3 floats, row by
  // row. The division is in double from the exact sums. Zero where nothing is merged.
  enum class Which { both, half0, half1 };
  std::vector<float> develop(std::uint32_t layer, Which which = Which::both) const;
  // The same for one row, before rounding to float. `out` has width * 3 values.
  void develop_row(std::uint32_t layer, std::uint32_t y, Which which, std::span<double> out) const;

 private:
  // 64-bit sums until one would overflow, then 128-bit: the values are the same, the memory is what is
  // needed. Order: [channel][y][x] within the tile. Both empty: all zero.
  struct TileSums {
    std::vector<std::int64_t> narrow;
    std::vector<Int128> wide;
    void widen();
  };
  // Invariant: |sum| <= merged.count() * 2^63, so 128 bits cannot overflow (indices are below 2^40).
  struct Half {
    std::vector<TileSums> tiles;  // [layer][tile], empty until touched
    IndexSet merged;
    Tallies tallies;
  };
  static void add_tile(TileSums& sums, std::span<const std::int64_t> values);
  static void add_tile(TileSums& sums, std::span<const Int128> values);
  void serialise_half(std::string& out, const Half& half) const;
  Result<void> parse_half(std::string_view& rest, Half& half) const;

  Layout layout_;
  int scale_log2_;
  std::array<Half, 2> halves_;
};

}  // namespace candela::film
