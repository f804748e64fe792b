// The wire form of a unit's film.
//
// Bytes: "CNDLDLT1"; width, height, layers, scale_log2 (u32 each); kind, half (u8 each); begin, end (u64);
// job id, build id (u16 length, bytes); tallies (7 u64); runs of touched tiles; for each group of 32 tiles
// and each channel its byte planes; XXH64 of all before (u64). Integers are little-endian.
#include "common/film/delta.h"

#include <algorithm>
#include <utility>

#include "common/film/codec.h"
#include "common/film/unit_film.h"

namespace candela::film {

namespace {

constexpr std::string_view kMagic = "CNDLDLT1";

void put_text(std::string& out, const std::string& text) {
  put_u16(out, static_cast<std::uint16_t>(text.size()));
  out.append(text, 0, 0xffff);
}

Result<std::string> read_text(Reader& reader, const char* field) {
  const std::uint16_t size = reader.u16();
  if (size > Limits::max_name_bytes) return input_error("a delta's id is too long").with_field(field);
  return std::string(reader.bytes(size));
}

}  // namespace

std::string encode_delta(const UnitFilm& film, const DeltaInfo& info) {
  const Layout& layout = film.layout();
  const std::int64_t* sums = film.sums();
  std::vector<std::uint32_t> tiles;
  for (std::size_t tile = 0; tile < layout.tile_count(); ++tile) {
    if (!film.touched(tile)) continue;
    const TileRect rect = tile_rect(layout, tile);
    bool zero = true;
    for (std::uint32_t y = rect.y; zero && y < rect.y + rect.height; ++y) {
      const std::int64_t* row =
          sums + ((std::size_t{rect.layer} * layout.height + y) * layout.width + rect.x) * kChannels;
      zero =
          std::all_of(row, row + std::size_t{rect.width} * kChannels, [](std::int64_t v) { return v == 0; });
    }
    if (!zero) tiles.push_back(static_cast<std::uint32_t>(tile));
  }

  std::string out(kMagic);
  out.reserve(1024 + tiles.size() * kTileSize * kTileSize * kChannels * 3);
  put_layout(out, layout, film.scale_log2());
  put_u8(out, static_cast<std::uint8_t>(info.unit.kind));
  put_u8(out, static_cast<std::uint8_t>(info.unit.half));
  put_u64(out, info.unit.begin);
  put_u64(out, info.unit.end);
  put_text(out, info.job_id);
  put_text(out, info.build_id);
  put_tallies(out, film.tallies());
  put_tiles(out, tiles);

  PlaneWriter writer;
  std::array<std::vector<std::uint64_t>, kChannels> codes;
  for (auto& channel : codes) channel.resize(kGroupTiles * kTileSize * kTileSize);
  for (std::size_t first = 0; first < tiles.size(); first += kGroupTiles) {
    const std::size_t last = std::min(tiles.size(), first + kGroupTiles);
    std::size_t values = 0;
    for (std::size_t t = first; t < last; ++t) {
      const TileRect rect = tile_rect(layout, tiles[t]);
      for (std::uint32_t y = rect.y; y < rect.y + rect.height; ++y) {
        const std::int64_t* row =
            sums + ((std::size_t{rect.layer} * layout.height + y) * layout.width + rect.x) * kChannels;
        for (std::size_t c = 0; c < kChannels; ++c) {
          std::uint64_t* to = codes[c].data() + values;
          for (std::uint32_t x = 0; x < rect.width; ++x) to[x] = zigzag(row[x * kChannels + c]);
        }
        values += rect.width;
      }
    }
    for (const auto& channel : codes) writer.put(out, std::span(channel).first(values), {});
  }
  seal(out);
  return out;
}

Result<Delta> Delta::decode(std::string_view bytes, const Layout& expected) {
  CANDELA_ASSIGN(const std::string_view content, unseal(bytes, kMagic, "the delta"));
  Reader reader(content);
  Delta delta;
  DeltaInfo& info = delta.info_;
  info.layout.width = reader.u32();
  info.layout.height = reader.u32();
  info.layout.layers = reader.u32();
  info.scale_log2 = static_cast<std::int32_t>(reader.u32());
  if (!reader.ok()) return input_error("the delta ends in its header").with_field("length");
  CANDELA_TRY(validate(info.layout, info.scale_log2));
  if (info.layout != expected) {
    return input_error("the delta is of a film of " + std::to_string(info.layout.width) + " x " +
                       std::to_string(info.layout.height) + " x " + std::to_string(info.layout.layers) +
                       ", the job's is of " + std::to_string(expected.width) + " x " +
                       std::to_string(expected.height) + " x " + std::to_string(expected.layers))
        .with_field("layout");
  }
  const std::uint8_t kind = reader.u8();
  info.unit.half = reader.u8();
  info.unit.begin = reader.u64();
  info.unit.end = reader.u64();
  if (kind > static_cast<std::uint8_t>(Unit::Kind::segments) ||
      kind == static_cast<std::uint8_t>(Unit::Kind::bootstrap)) {  // a bootstrap makes no film
    return input_error("the delta is of an unknown kind of unit").with_field("kind");
  }
  info.unit.kind = static_cast<Unit::Kind>(kind);
  const bool iterations = info.unit.kind != Unit::Kind::pilot;
  if (info.unit.half > 1 || info.unit.end > Limits::max_iterations || info.unit.begin > info.unit.end ||
      (iterations && info.unit.begin == info.unit.end)) {
    return input_error("the delta's range of iterations is not possible").with_field("unit");
  }
  CANDELA_ASSIGN(info.job_id, read_text(reader, "job_id"));
  CANDELA_ASSIGN(info.build_id, read_text(reader, "build_id"));
  delta.tallies_ = read_tallies(reader);
  CANDELA_ASSIGN(delta.tiles_, read_tiles(reader, expected.tile_count()));

  PlaneReader planes;
  for (std::size_t first = 0; first < delta.tiles_.size(); first += kGroupTiles) {
    Group group;
    group.first = first;
    group.count = std::min(kGroupTiles, delta.tiles_.size() - first);
    std::size_t values = 0;
    for (std::size_t t = first; t < first + group.count; ++t)
      values += tile_rect(expected, delta.tiles_[t]).pixels();
    for (PlaneSet& channel : group.channels) {
      CANDELA_ASSIGN(channel, planes.read(reader, values, 8));
    }
    std::size_t offset = 0;
    for (std::size_t t = first; t < first + group.count; ++t) {
      const std::size_t pixels = tile_rect(expected, delta.tiles_[t]).pixels();
      if (!std::any_of(group.channels.begin(), group.channels.end(),
                       [&](const PlaneSet& channel) { return any(channel, offset, pixels); })) {
        return input_error("the delta lists a tile that is all zero").with_field("tiles");
      }
      offset += pixels;
    }
    delta.groups_.push_back(std::move(group));
  }
  if (!reader.ok() || !reader.rest().empty()) {
    return input_error("the delta has " + std::to_string(reader.rest().size()) + " bytes too many")
        .with_field("length");
  }
  return delta;
}

}  // namespace candela::film
