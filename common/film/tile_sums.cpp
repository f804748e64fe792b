#include "common/film/tile_sums.h"

#include <algorithm>
#include <new>

namespace candela::film {
namespace {

void add_tile(TileSums::Tile& to, const TileSums::Tile& from) {
  if (!from.wide.empty()) {
    to.add(std::span<const Int128>(from.wide));
  } else if (!from.narrow.empty()) {
    to.add(std::span<const std::int64_t>(from.narrow));
  }
}
// Takes back what add_tile() added. Allocates nothing.
void subtract_tile(TileSums::Tile& to, const TileSums::Tile& from) {
  if (!from.narrow.empty()) to.subtract(from.narrow);
  for (std::size_t i = 0; i < from.wide.size(); ++i) to.wide[i] -= from.wide[i];  // add_tile() widened it
}

}  // namespace

void TileSums::Tile::widen() {
  wide.assign(narrow.begin(), narrow.end());
  std::vector<std::int64_t>().swap(narrow);
}

void TileSums::Tile::add(std::span<const std::int64_t> values) {
  if (wide.empty()) {
    if (narrow.empty()) {
      narrow.assign(values.begin(), values.end());
      return;
    }
    // Signs of the operands equal and of the sum different: overflow. Then the sums are taken back, modulo
    // 2^64 as they were made, and the tile is widened.
    std::int64_t* to = narrow.data();
    std::int64_t overflow = 0;
    for (std::size_t i = 0; i < values.size(); ++i) {
      const auto sum = static_cast<std::int64_t>(static_cast<std::uint64_t>(to[i]) +
                                                 static_cast<std::uint64_t>(values[i]));
      overflow |= (to[i] ^ sum) & (values[i] ^ sum);
      to[i] = sum;
    }
    if (overflow >= 0) return;
    for (std::size_t i = 0; i < values.size(); ++i)
      to[i] = static_cast<std::int64_t>(static_cast<std::uint64_t>(to[i]) -
                                        static_cast<std::uint64_t>(values[i]));
    widen();
  }
  for (std::size_t i = 0; i < values.size(); ++i) wide[i] += values[i];
}

void TileSums::Tile::add(std::span<const Int128> values) {
  if (wide.empty()) {
    if (narrow.empty()) {
      wide.assign(values.begin(), values.end());
      return;
    }
    widen();
  }
  for (std::size_t i = 0; i < values.size(); ++i) wide[i] += values[i];
}

// Modulo 2^64, as the values were added: the sum before fits, for the tile had it.
void TileSums::Tile::subtract(std::span<const std::int64_t> values) {
  for (std::size_t i = 0; i < narrow.size(); ++i)
    narrow[i] = static_cast<std::int64_t>(static_cast<std::uint64_t>(narrow[i]) -
                                          static_cast<std::uint64_t>(values[i]));
  for (std::size_t i = 0; i < wide.size(); ++i) wide[i] -= values[i];
}

bool TileSums::Tile::zero() const {
  const auto is_zero = [](auto value) { return value == 0; };
  return std::all_of(narrow.begin(), narrow.end(), is_zero) && std::all_of(wide.begin(), wide.end(), is_zero);
}

void TileSums::reserve(const SparseSums& sums) {
  sums.for_each_size([&](std::size_t tile, std::size_t values) {
    if (tiles_[tile].wide.empty()) tiles_[tile].narrow.reserve(values);
  });
}

void TileSums::add(const SparseSums& sums) {
  reserve(sums);
  SparseSums::TileBuffers buffers(channels_);
  std::size_t next = 0;  // the first tile that is not added
  try {
    sums.for_each_tile(buffers, [&](std::size_t tile, std::span<const std::int64_t> values) {
      tiles_[tile].add(values);
      next = tile + 1;
    });
  } catch (const std::bad_alloc&) {
    sums.for_each_tile(buffers, [&](std::size_t tile, std::span<const std::int64_t> values) {
      if (tile < next) tiles_[tile].subtract(values);
    });
    throw;
  }
}

void TileSums::subtract(const SparseSums& sums, SparseSums::TileBuffers& buffers) {
  sums.for_each_tile(buffers, [&](std::size_t tile, std::span<const std::int64_t> values) {
    tiles_[tile].subtract(values);
  });
}

void TileSums::add(const TileSums& other) {
  std::size_t next = 0;  // the first tile that is not added
  try {
    for (; next < tiles_.size(); ++next) add_tile(tiles_[next], other.tiles_[next]);
  } catch (const std::bad_alloc&) {
    while (next-- > 0) subtract_tile(tiles_[next], other.tiles_[next]);
    throw;
  }
}

TilePlace tile_place(const Layout& layout, std::uint32_t layer, std::uint32_t x, std::uint32_t y) {
  TilePlace place{};
  place.tile = (std::size_t{layer} * layout.tiles_y() + y / kTileSize) * layout.tiles_x() + x / kTileSize;
  const TileRect rect = tile_rect(layout, place.tile);
  place.offset = std::size_t{y - rect.y} * rect.width + (x - rect.x);
  place.pixels = rect.pixels();
  return place;
}

Int128 TileSums::sum(std::uint32_t layer, std::uint32_t x, std::uint32_t y, std::uint32_t channel) const {
  const TilePlace at = tile_place(layout_, layer, x, y);
  const Tile& tile = tiles_[at.tile];
  const std::size_t index = channel * at.pixels + at.offset;
  if (!tile.wide.empty()) return tile.wide[index];
  if (!tile.narrow.empty()) return tile.narrow[index];
  return 0;
}

void TileSums::get_pixel(std::uint32_t layer, std::uint32_t x, std::uint32_t y,
                         std::span<Int128> sums) const {
  const TilePlace at = tile_place(layout_, layer, x, y);
  const Tile& tile = tiles_[at.tile];
  for (std::size_t c = 0, i = at.offset; c < sums.size(); ++c, i += at.pixels)
    sums[c] = !tile.narrow.empty() ? tile.narrow[i] : !tile.wide.empty() ? tile.wide[i] : Int128{0};
}

void TileSums::set_pixel(std::uint32_t layer, std::uint32_t x, std::uint32_t y,
                         std::span<const Int128> sums) {
  const TilePlace at = tile_place(layout_, layer, x, y);
  Tile& tile = tiles_[at.tile];
  const auto is_zero = [](Int128 value) { return value == 0; };
  const auto fits = [](Int128 value) { return value == static_cast<std::int64_t>(value); };
  if (tile.narrow.empty() && tile.wide.empty()) {
    if (std::all_of(sums.begin(), sums.end(), is_zero)) return;
    tile.narrow.assign(at.pixels * channels_, 0);
  }
  if (tile.wide.empty() && !std::all_of(sums.begin(), sums.end(), fits)) tile.widen();
  for (std::size_t c = 0, i = at.offset; c < sums.size(); ++c, i += at.pixels) {
    if (tile.wide.empty())
      tile.narrow[i] = static_cast<std::int64_t>(sums[c]);
    else
      tile.wide[i] = sums[c];
  }
}

bool TileSums::zero(std::size_t tile_count) const {
  return std::all_of(tiles_.begin(), tiles_.begin() + static_cast<std::ptrdiff_t>(tile_count),
                     [](const Tile& tile) { return tile.zero(); });
}

std::uint64_t TileSums::memory_bytes() const {
  std::uint64_t bytes = 0;
  for (const Tile& tile : tiles_)
    bytes += tile.narrow.size() * sizeof(std::int64_t) + tile.wide.size() * sizeof(Int128);
  return bytes;
}

TileSums TileSums::first_layers(const Layout& layout) const {
  TileSums out(layout, channels_);
  std::copy_n(tiles_.begin(), out.tiles_.size(), out.tiles_.begin());  // layer after layer
  return out;
}

void TileSums::put(std::string& out) const {
  std::vector<std::uint32_t> tiles;
  for (std::size_t tile = 0; tile < tiles_.size(); ++tile)
    if (!tiles_[tile].zero()) tiles.push_back(static_cast<std::uint32_t>(tile));
  put_tiles(out, tiles);

  PlaneWriter writer;
  std::vector<std::uint64_t> low, high;
  for (std::size_t first = 0; first < tiles.size(); first += kGroupTiles) {
    const std::size_t last = std::min(tiles.size(), first + kGroupTiles);
    for (std::size_t c = 0; c < channels_; ++c) {
      low.clear();
      high.clear();
      for (std::size_t t = first; t < last; ++t) {
        const Tile& sums = tiles_[tiles[t]];
        const std::size_t pixels = tile_rect(layout_, tiles[t]).pixels();
        for (std::size_t i = c * pixels; i < (c + 1) * pixels; ++i) {
          if (sums.wide.empty()) {
            low.push_back(zigzag(sums.narrow[i]));
            high.push_back(0);
          } else {
            const Int128 value = sums.wide[i];
            const Uint128 code = (static_cast<Uint128>(value) << 1) ^ static_cast<Uint128>(value >> 127);
            low.push_back(static_cast<std::uint64_t>(code));
            high.push_back(static_cast<std::uint64_t>(code >> 64));
          }
        }
      }
      writer.put(out, low, high);
    }
  }
}

Result<void> TileSums::read(Reader& reader, Uint128 bound, std::string_view what) {
  const auto bad = [&](std::string_view text) {
    return input_error(std::string(what) + std::string(text)).with_field("tiles");
  };
  CANDELA_ASSIGN(const std::vector<std::uint32_t> tiles, read_tiles(reader, layout_.tile_count()));
  PlaneReader planes;
  std::vector<std::uint64_t> low(kTileSize * kTileSize), high(kTileSize * kTileSize);
  std::vector<PlaneSet> channels(channels_);
  std::vector<Int128> wide;
  for (std::size_t first = 0; first < tiles.size(); first += kGroupTiles) {
    const std::size_t last = std::min(tiles.size(), first + kGroupTiles);
    std::size_t values = 0;
    for (std::size_t t = first; t < last; ++t) values += tile_rect(layout_, tiles[t]).pixels();
    for (PlaneSet& channel : channels) {
      CANDELA_ASSIGN(channel, planes.read(reader, values, PlaneSet::kMaxPlanes));
    }
    std::size_t offset = 0;
    for (std::size_t t = first; t < last; ++t) {
      const std::size_t pixels = tile_rect(layout_, tiles[t]).pixels();
      wide.clear();
      bool fits = true;
      bool zero = true;
      for (const PlaneSet& channel : channels) {
        expand_low(channel, offset, std::span(low).first(pixels));
        expand_high(channel, offset, std::span(high).first(pixels));
        for (std::size_t i = 0; i < pixels; ++i) {
          const Uint128 code = (static_cast<Uint128>(high[i]) << 64) | low[i];
          const auto value = static_cast<Int128>((code >> 1) ^ (~(code & 1) + 1));
          // |value| <= bound; the bound is at most 2^103, so the conversion is exact.
          if (value > static_cast<Int128>(bound) || value < -static_cast<Int128>(bound))
            return bad(" has a sum larger than its iterations allow");
          zero &= value == 0;
          fits &= value == static_cast<std::int64_t>(value);
          wide.push_back(value);
        }
      }
      if (zero) return bad(" lists a tile that is all zero");
      Tile& sums = tiles_[tiles[t]];
      if (fits) {
        sums.narrow.reserve(wide.size());
        for (const Int128 value : wide) sums.narrow.push_back(static_cast<std::int64_t>(value));
      } else {
        sums.wide = wide;
      }
      offset += pixels;
    }
  }
  if (!reader.ok()) return input_error(std::string(what) + " ends too early").with_field("length");
  return {};
}

}  // namespace candela::film
