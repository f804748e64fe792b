// Exact sums by pixel and key: in each pixel the keys that were added there, of a set that is known before
// (objects of a scene). No key of a pixel gives way to another, so the sums do not depend on the order in
// which they come (docs/decisions/048).
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/hash.h"
#include "common/base/result.h"
#include "common/film/codec.h"
#include "common/film/layout.h"
#include "common/film/tile_sums.h"

namespace candela::film {

// Sums of a unit, or of any number of units.
class KeyedSums {
 public:
  // The pairs of pixel and key of one tile, ascending, and as many sums: 64 bits until one would overflow.
  struct Tile {
    std::vector<std::uint64_t> places;  // pixel within the tile << 32 | key
    TileSums::Tile sums;
  };

  KeyedSums() = default;
  explicit KeyedSums(const Layout& layout) : layout_(layout), tiles_(layout.tile_count()) {}

  // Preconditions of these: both have one layout.
  // If memory runs out, no sum changes: std::bad_alloc.
  void add(const KeyedSums& other);
  // Makes a pair, with the sum 0, for each of the other's. After it add() allocates only to widen a tile.
  void reserve(const KeyedSums& other);
  // The pairs that reserve() would leave.
  std::uint64_t pairs_with(const KeyedSums& other) const;
  // Takes back what add() added, and drops pairs of the other's tiles whose sum is 0. Allocates nothing.
  void subtract(const KeyedSums& other);

  // Precondition: places ascend, and the tile has none yet.
  void set_tile(std::size_t tile, std::span<const std::pair<std::uint64_t, std::int64_t>> places);

  struct KeySum {
    std::uint32_t key;
    Int128 sum;
  };
  // The keys of a pixel, ascending. Replaces `out`. Sums of 0 may be among them.
  void get_pixel(std::uint32_t x, std::uint32_t y, std::vector<KeySum>& out) const;
  bool has_tiles() const { return !tiles_.empty(); }  // false: made without a layout
  std::uint64_t pairs() const;
  std::uint64_t memory_bytes() const;

  // Stored form and that of deltas: runs of tiles that have a sum but 0; for each group of 32 tiles the
  // number of its pairs in each (u32), and as byte planes: the distances of pixels from those before, the
  // keys, and the sums as zigzag integers. Pairs whose sum is 0 are left out: equal sums give equal bytes.
  void put(std::string& out) const;
  // Fails (input) on anything that put() does not write, if a key is `keys` or more, if there are more than
  // `max_pairs`, and if |sum| > bound; `what` names the whole. Memory is bounded by max_pairs.
  static Result<KeyedSums> read(Reader& reader, const Layout& layout, std::uint32_t keys,
                                std::uint64_t max_pairs, Uint128 bound, std::string_view what);
  // Feeds what determines the sums. Equal sums give equal bytes.
  void hash_into(Sha256& hash) const;

 private:
  Layout layout_;
  std::vector<Tile> tiles_;
};

// Sums of a unit while threads add to them.
class UnitKeys {
 public:
  UnitKeys();
  explicit UnitKeys(const Layout& layout);
  ~UnitKeys();
  UnitKeys(UnitKeys&&) noexcept;
  UnitKeys& operator=(UnitKeys&&) noexcept;

  // From any thread. Returns true if the sum wrapped around.
  bool add(std::uint32_t x, std::uint32_t y, std::uint32_t key, std::int64_t units);
  KeyedSums sums() const;
  std::uint64_t pairs() const;
  void clear();

 private:
  struct Tile;
  Layout layout_;
  std::vector<std::unique_ptr<Tile>> tiles_;
};

}  // namespace candela::film
