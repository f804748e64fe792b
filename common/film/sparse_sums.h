// The sums of one unit as a delta carries them: 64-bit integers on a grid of pixels, without the tiles that
// are all zero.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "common/base/hash.h"
#include "common/base/result.h"
#include "common/film/codec.h"
#include "common/film/layout.h"

namespace candela::film {

// Appends the indices of the tiles that are not all zero, as runs, and for each group of 32 of them and each
// channel its byte planes of zigzag integers. `sums`: [layer][y][x][channel]. A tile whose `touched` is 0 has
// no sum but zero. Equal sums give equal bytes, whatever was touched.
void put_sums(std::string& out, const Layout& layout, std::uint32_t channels,
              std::span<const std::int64_t> sums, std::span<const std::uint8_t> touched);

// Checked sums, kept as byte planes (a third of the memory of the sums) until they are merged.
class SparseSums {
 public:
  // Reads exactly what put_sums() wrote for this layout and number of channels. Fails (input) on anything
  // else. Memory is bounded by the layout and the channels.
  static Result<SparseSums> read(Reader& reader, const Layout& layout, std::uint32_t channels);

  // Memory of for_each_tile(), for sums of so many channels.
  struct TileBuffers {
    explicit TileBuffers(std::uint32_t channels)
        : codes(kTileSize * kTileSize), values(codes.size() * channels) {}
    std::vector<std::uint64_t> codes;
    std::vector<std::int64_t> values;
  };
  // Calls visit(tile, values) for each tile in ascending order; `values` are [channel][y][x] within the tile.
  template <class Visit>
  void for_each_tile(Visit&& visit) const {
    TileBuffers buffers(channels_);
    for_each_tile(buffers, visit);
  }
  // The same, and allocates nothing. Precondition: `buffers` are for as many channels at least.
  template <class Visit>
  void for_each_tile(TileBuffers& buffers, Visit&& visit) const {
    std::vector<std::uint64_t>& codes = buffers.codes;
    std::vector<std::int64_t>& values = buffers.values;
    for (const Group& group : groups_) {
      std::size_t offset = 0;
      for (std::size_t t = group.first; t < group.first + group.count; ++t) {
        const std::size_t pixels = tile_rect(layout_, tiles_[t]).pixels();
        for (std::size_t c = 0; c < channels_; ++c) {
          expand_low(group.channels[c], offset, std::span(codes).first(pixels));
          std::int64_t* to = values.data() + c * pixels;
          for (std::size_t i = 0; i < pixels; ++i) to[i] = unzigzag(codes[i]);
        }
        visit(std::size_t{tiles_[t]}, std::span<const std::int64_t>(values).first(pixels * channels_));
        offset += pixels;
      }
    }
  }
  // Calls visit(tile, number of values) for each tile in ascending order.
  template <class Visit>
  void for_each_size(Visit&& visit) const {
    for (const std::uint32_t tile : tiles_)
      visit(std::size_t{tile}, std::size_t{tile_rect(layout_, tile).pixels()} * channels_);
  }
  std::uint32_t channels() const { return channels_; }
  // Feeds what determines the sums, whatever a compressor made of them. Equal sums give equal bytes.
  void hash_into(Sha256& hash) const;

 private:
  // Consecutive entries of tiles_.
  struct Group {
    std::size_t first = 0, count = 0;
    std::vector<PlaneSet> channels;
  };
  Layout layout_;
  std::uint32_t channels_ = 0;
  std::vector<std::uint32_t> tiles_;  // ascending indices
  std::vector<Group> groups_;
};

}  // namespace candela::film
