// Exact sums of any number of units on a grid of tiles. Integers add the same in any order (law 3).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/film/codec.h"
#include "common/film/layout.h"
#include "common/film/sparse_sums.h"

namespace candela::film {

__extension__ using Int128 = __int128;            // a GCC extension that -Wpedantic wants declared
__extension__ using Uint128 = unsigned __int128;  // the same

class TileSums {
 public:
  // 64-bit sums until one would overflow, then 128-bit: the values are the same, the memory is what is
  // needed. Order: [channel][y][x] within the tile. Both empty: all zero.
  struct Tile {
    std::vector<std::int64_t> narrow;
    std::vector<Int128> wide;
    void add(std::span<const std::int64_t> values);
    void add(std::span<const Int128> values);
    void subtract(std::span<const std::int64_t> values);
    bool zero() const;
    void widen();
  };

  TileSums() = default;
  TileSums(const Layout& layout, std::uint32_t channels)
      : layout_(layout), channels_(channels), tiles_(layout.tile_count()) {}

  // Preconditions of these: `sums` and `other` have this layout and number of channels.
  // If memory runs out, nothing is added: std::bad_alloc.
  void add(const SparseSums& sums);
  // Takes memory for what add() of these sums fills. After it, add() allocates only to widen a tile.
  void reserve(const SparseSums& sums);
  // Takes back what add() added. Allocates nothing. Precondition: `buffers` are for these channels at least.
  void subtract(const SparseSums& sums, SparseSums::TileBuffers& buffers);
  void add(const TileSums& other);

  const Tile& tile(std::size_t index) const { return tiles_[index]; }
  Int128 sum(std::uint32_t layer, std::uint32_t x, std::uint32_t y, std::uint32_t channel) const;
  // All channels of a pixel. Precondition: `sums` has one for each.
  void get_pixel(std::uint32_t layer, std::uint32_t x, std::uint32_t y, std::span<Int128> sums) const;
  void set_pixel(std::uint32_t layer, std::uint32_t x, std::uint32_t y, std::span<const Int128> sums);
  // No sum of the first `tile_count` tiles differs from zero.
  bool zero(std::size_t tile_count) const;
  // Bytes of the sums. A tile without sums takes none.
  std::uint64_t memory_bytes() const;
  // A copy of the first layers alone.
  TileSums first_layers(const Layout& layout) const;

  // Stored form: runs of tiles that are not all zero, and for each group of 32 tiles and each channel its
  // byte planes. Sums are coded as 128-bit zigzag integers, so the bytes do not tell how wide a tile is in
  // memory: equal sums give equal bytes.
  void put(std::string& out) const;
  // Precondition: all sums are zero. Fails (input) on anything that put() does not write, and where
  // |sum| > bound; `what` names the whole, as "the film".
  Result<void> read(Reader& reader, Uint128 bound, std::string_view what);

 private:
  Layout layout_;
  std::uint32_t channels_ = 0;
  std::vector<Tile> tiles_;  // [layer][tile]
};

// A pixel's tile, its offset there, and how many pixels the tile has.
struct TilePlace {
  std::size_t tile;
  std::size_t offset;
  std::size_t pixels;
};
TilePlace tile_place(const Layout& layout, std::uint32_t layer, std::uint32_t x, std::uint32_t y);

}  // namespace candela::film
