// Exact film tallies. Every contribution is quantised once to an integer with the job's scale; integers add the same in
// any order, so merging is commutative and associative, and idempotence comes from the set of merged iterations kept
// beside the sums (law 3).
//
// Rounding is stochastic and unbiased: floor(value * 2^log2 + u), u uniform in [0,1) from a hash of the sample's key, so
// E[tally] = value * 2^log2 exactly, however small the value, and the result depends on the sample alone.
#pragma once

#include <array>
#include <atomic>
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

inline constexpr int kTileSize = 32;  // pixels a side; the unit of sparseness in deltas and of width in merged films
inline constexpr int kChannels = 3;   // linear Rec.709 R, G, B

struct Layout {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::uint32_t layers = 1;  // layer 0 is the image
  bool operator==(const Layout&) const = default;
  std::size_t pixel_count() const { return std::size_t{width} * height; }
};

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

// Quantises a finite value (negative allowed: filters with lobes). `dither` is uniform in [0, 1).
inline std::int64_t quantise(double value, double units_per_value, double dither) {
  return static_cast<std::int64_t>(std::floor(value * units_per_value + dither));
}

// The accumulator of one unit. Sized for the whole film; touched tiles are known.
class UnitFilm {
 public:
  UnitFilm(Layout layout, int scale_log2);

  const Layout& layout() const { return layout_; }
  int scale_log2() const { return scale_log2_; }

  // Adds one sample's r, g, b to a pixel that only the calling thread touches (eye paths: threads own tiles). `key` names
  // the sample (seed, iteration, pixel, ...) and seeds the rounding. A value that is NaN, infinite, saturated, or
  // negative where `signed_values` is false counts in `tallies.rejected` and leaves the film alone, all channels of it.
  // Returns false if it was rejected.
  bool add(std::uint32_t layer, std::uint32_t x, std::uint32_t y, const std::array<float, kChannels>& rgb,
           std::uint64_t key, Tallies& tallies, bool signed_values = false);

  // The same from any thread (light paths): relaxed atomic adds.
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
  Layout layout_;
  int scale_log2_;
  double units_per_value_;
  std::uint32_t tiles_x_, tiles_y_;
  std::vector<std::int64_t> sums_;          // [layer][y][x][channel]
  std::vector<std::uint8_t> touched_;       // [layer][tile]; written with relaxed atomic stores
  std::atomic<bool> overflowed_{false};
  mutable std::atomic_flag lock_ = ATOMIC_FLAG_INIT;
  Tallies tallies_;
};

// Disjoint sorted half-open ranges of sequence indices.
class IndexSet {
 public:
  // Adds [begin, end). False, and nothing changed, if it is empty or overlaps what is there.
  bool insert(std::uint64_t begin, std::uint64_t end);
  bool intersects(std::uint64_t begin, std::uint64_t end) const;
  std::uint64_t count() const;
  // The first gap at or after `from`, cut to `limit`: {begin, end}, empty (begin == end) if there is none below limit.
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

// Wire form of a unit's film: header, tallies, touched tiles compressed (byte planes of zigzag integers, zstd), checksum.
// Deterministic: equal films give equal bytes.
std::string encode_delta(const UnitFilm& film, const DeltaInfo& info);

// A checked, decoded delta.
class Delta {
 public:
  // Fails on anything that is not the whole and unchanged output of encode_delta: wrong magic, length, checksum, tile
  // index, decompressed size, trailing bytes. Memory is bounded by the layout in `expected`, which must match.
  static Result<Delta> decode(std::string_view bytes, const Layout& expected);
  const DeltaInfo& info() const { return info_; }
  const Tallies& tallies() const { return tallies_; }

 private:
  friend class MergedFilm;
  struct Tile {
    std::uint32_t layer, tile_x, tile_y;
    std::vector<std::int64_t> sums;  // tile height * tile width * channels, cut at the film's border
  };
  DeltaInfo info_;
  Tallies tallies_;
  std::vector<Tile> tiles_;
};

// The job's film: two halves, each exact sums, tallies, and the set of merged indices.
class MergedFilm {
 public:
  MergedFilm(Layout layout, int scale_log2);

  const Layout& layout() const { return layout_; }
  int scale_log2() const { return scale_log2_; }

  // Adds a delta of kind iterations. Refused, and nothing changed, if its layout or scale differ or any of its indices is
  // merged already.
  Result<void> merge(const Delta& delta);
  // Adds another film of the same job (a relay's, or a shard's) under the same rules.
  Result<void> merge(const MergedFilm& other);

  const IndexSet& merged(std::uint32_t half) const { return halves_[half].merged; }
  const Tallies& tallies(std::uint32_t half) const { return halves_[half].tallies; }
  std::uint64_t iterations() const { return halves_[0].merged.count() + halves_[1].merged.count(); }

  // Checkpoint form: everything above, compressed, with a checksum. parse() accepts exactly what serialise() makes.
  std::string serialise() const;
  static Result<MergedFilm> parse(std::string_view bytes);

  // Sum of one half in film units (128 bits).
  __int128 sum(std::uint32_t half, std::uint32_t layer, std::uint32_t x, std::uint32_t y, int channel) const;

  // Mean over iterations of one layer, both halves together or one of them: width * height * 3 floats, row by row. The
  // division is in double from the exact sums. Zero where nothing is merged.
  enum class Which { both, half0, half1 };
  std::vector<float> develop(std::uint32_t layer, Which which = Which::both) const;

 private:
  // 64-bit sums until one would overflow, then 128-bit: the values are the same, the memory is what is needed.
  struct TileSums {
    std::vector<std::int64_t> narrow;
    std::vector<__int128> wide;
  };
  struct Half {
    std::vector<TileSums> tiles;  // [layer][tile], empty until touched
    IndexSet merged;
    Tallies tallies;
  };
  void add_tile(TileSums& sums, std::span<const std::int64_t> values);

  Layout layout_;
  int scale_log2_;
  std::uint32_t tiles_x_, tiles_y_;
  std::array<Half, 2> halves_;
};

}  // namespace candela::film
