#include "common/film/sparse_sums.h"

#include <algorithm>
#include <bit>
#include <utility>

namespace candela::film {

void put_sums(std::string& out, const Layout& layout, std::uint32_t channels,
              std::span<const std::int64_t> sums, std::span<const std::uint8_t> touched) {
  const auto row_of = [&](const TileRect& rect, std::uint32_t y) {
    return sums.subspan(((std::size_t{rect.layer} * layout.height + y) * layout.width + rect.x) * channels,
                        std::size_t{rect.width} * channels);
  };
  std::vector<std::uint32_t> tiles;
  for (std::size_t tile = 0; tile < layout.tile_count(); ++tile) {
    if (touched[tile] == 0) continue;
    const TileRect rect = tile_rect(layout, tile);
    bool zero = true;
    for (std::uint32_t y = rect.y; zero && y < rect.y + rect.height; ++y) {
      const auto row = row_of(rect, y);
      zero = std::all_of(row.begin(), row.end(), [](std::int64_t v) { return v == 0; });
    }
    if (!zero) tiles.push_back(static_cast<std::uint32_t>(tile));
  }
  out.reserve(out.size() + 1024 + tiles.size() * kTileSize * kTileSize * channels * 3);
  put_tiles(out, tiles);

  PlaneWriter writer;
  std::vector<std::vector<std::uint64_t>> codes(
      channels, std::vector<std::uint64_t>(kGroupTiles * kTileSize * kTileSize));
  for (std::size_t first = 0; first < tiles.size(); first += kGroupTiles) {
    const std::size_t last = std::min(tiles.size(), first + kGroupTiles);
    std::size_t values = 0;
    for (std::size_t t = first; t < last; ++t) {
      const TileRect rect = tile_rect(layout, tiles[t]);
      for (std::uint32_t y = rect.y; y < rect.y + rect.height; ++y) {
        const auto row = row_of(rect, y);
        for (std::size_t c = 0; c < channels; ++c) {
          std::uint64_t* to = codes[c].data() + values;
          const std::int64_t* from = row.data() + c;
          for (std::size_t x = 0, width = rect.width; x < width; ++x, from += channels) to[x] = zigzag(*from);
        }
        values += rect.width;
      }
    }
    for (const auto& channel : codes) writer.put(out, std::span(channel).first(values), {});
  }
}

Result<SparseSums> SparseSums::read(Reader& reader, const Layout& layout, std::uint32_t channels) {
  SparseSums sums;
  sums.layout_ = layout;
  sums.channels_ = channels;
  CANDELA_ASSIGN(sums.tiles_, read_tiles(reader, layout.tile_count()));
  PlaneReader planes;
  for (std::size_t first = 0; first < sums.tiles_.size(); first += kGroupTiles) {
    Group group;
    group.first = first;
    group.count = std::min(kGroupTiles, sums.tiles_.size() - first);
    group.channels.resize(channels);
    std::size_t values = 0;
    for (std::size_t t = first; t < first + group.count; ++t)
      values += tile_rect(layout, sums.tiles_[t]).pixels();
    for (PlaneSet& channel : group.channels) {
      CANDELA_ASSIGN(channel, planes.read(reader, values, 8));
    }
    std::size_t offset = 0;
    for (std::size_t t = first; t < first + group.count; ++t) {
      const std::size_t pixels = tile_rect(layout, sums.tiles_[t]).pixels();
      if (!std::any_of(group.channels.begin(), group.channels.end(),
                       [&](const PlaneSet& channel) { return any(channel, offset, pixels); })) {
        return input_error("the delta lists a tile that is all zero").with_field("tiles");
      }
      offset += pixels;
    }
    sums.groups_.push_back(std::move(group));
  }
  return sums;
}

void SparseSums::hash_into(Sha256& hash) const {
  std::string fields;
  put_u32(fields, channels_);
  put_u64(fields, tiles_.size());
  for (const std::uint32_t tile : tiles_) put_u32(fields, tile);
  hash.update(fields);
  for (const Group& group : groups_)
    for (const PlaneSet& channel : group.channels) {
      fields.clear();
      put_u32(fields, channel.present);
      hash.update(fields);
      hash.update({reinterpret_cast<const char*>(channel.bytes.get()),
                   channel.values * static_cast<std::size_t>(std::popcount(channel.present))});
    }
}

}  // namespace candela::film
