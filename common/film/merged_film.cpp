// The job's film: exact merging, the checkpoint form, and the image.
//
// Checkpoint bytes: "CANFILM1"; width, height, layers, scale_log2 (u32 each); for each half the number of
// ranges (u64) and the ranges (u64 begin, end), tallies (7 u64), runs of tiles that are not all zero, and for
// each group of 32 tiles and each channel its byte planes; XXH64 of all before (u64). Integers are
// little-endian. Sums are coded as 128-bit zigzag integers, so the bytes do not tell how wide a tile is in
// memory: equal content gives equal bytes.
#include "common/film/merged_film.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "common/film/codec.h"
#include "common/film/delta.h"
#include "common/job/job.h"

namespace candela::film {

namespace {

constexpr std::string_view kMagic = "CANFILM1";
__extension__ using Uint128 = unsigned __int128;

bool add_checked(std::uint64_t& sum, std::uint64_t value) {
  return !__builtin_add_overflow(sum, value, &sum);
}

// The sum of two tallies, or nothing if a count would wrap around.
std::optional<Tallies> sum_of(const Tallies& a, const Tallies& b) {
  Tallies sum = a;
  bool fits = add_checked(sum.eye_samples, b.eye_samples);
  fits &= add_checked(sum.light_paths, b.light_paths);
  fits &= add_checked(sum.rays, b.rays);
  for (std::size_t i = 0; i < sum.rejected.size(); ++i) fits &= add_checked(sum.rejected[i], b.rejected[i]);
  if (!fits) return std::nullopt;
  return sum;
}

Error overlap_error(std::uint32_t half, std::uint64_t begin, std::uint64_t end) {
  return refused_error("iterations [" + std::to_string(begin) + ", " + std::to_string(end) + ") of half " +
                       std::to_string(half) + " are merged already, at least in part")
      .with_field("unit");
}

// Where a pixel is in its tile, and how many pixels the tile has.
struct Place {
  std::size_t tile;
  std::size_t offset;
  std::size_t pixels;
};
Place place(const Layout& layout, std::uint32_t layer, std::uint32_t x, std::uint32_t y) {
  Place result{};
  result.tile = (std::size_t{layer} * layout.tiles_y() + y / kTileSize) * layout.tiles_x() + x / kTileSize;
  const TileRect rect = tile_rect(layout, result.tile);
  result.offset = std::size_t{y - rect.y} * rect.width + (x - rect.x);
  result.pixels = rect.pixels();
  return result;
}

}  // namespace

void MergedFilm::TileSums::widen() {
  wide.assign(narrow.begin(), narrow.end());
  std::vector<std::int64_t>().swap(narrow);
}

void MergedFilm::add_tile(TileSums& sums, std::span<const std::int64_t> values) {
  if (sums.wide.empty()) {
    if (sums.narrow.empty()) {
      sums.narrow.assign(values.begin(), values.end());
      return;
    }
    // Signs of the operands equal and of the sum different: overflow. Looked for in a pass of its own, so
    // that the tile is still whole if it must be widened.
    std::int64_t* to = sums.narrow.data();
    std::int64_t overflow = 0;
    for (std::size_t i = 0; i < values.size(); ++i) {
      const auto sum = static_cast<std::int64_t>(static_cast<std::uint64_t>(to[i]) +
                                                 static_cast<std::uint64_t>(values[i]));
      overflow |= (to[i] ^ sum) & (values[i] ^ sum);
    }
    if (overflow >= 0) {
      for (std::size_t i = 0; i < values.size(); ++i) to[i] += values[i];
      return;
    }
    sums.widen();
  }
  for (std::size_t i = 0; i < values.size(); ++i) sums.wide[i] += values[i];
}

void MergedFilm::add_tile(TileSums& sums, std::span<const Int128> values) {
  if (sums.wide.empty()) {
    if (sums.narrow.empty()) {
      sums.wide.assign(values.begin(), values.end());
      return;
    }
    sums.widen();
  }
  for (std::size_t i = 0; i < values.size(); ++i) sums.wide[i] += values[i];
}

MergedFilm::MergedFilm(Layout layout, int scale_log2) : layout_(layout), scale_log2_(scale_log2) {
  for (Half& half : halves_) half.tiles.resize(layout.tile_count());
}

Result<void> MergedFilm::merge(const Delta& delta) {
  const DeltaInfo& info = delta.info_;
  const Unit& unit = info.unit;
  if (info.layout != layout_ || info.scale_log2 != scale_log2_) {
    return refused_error("the delta is of another film: its layout or scale differ").with_field("layout");
  }
  const bool counted = unit.kind == Unit::Kind::iterations || unit.kind == Unit::Kind::segments;
  if (!counted || unit.half > 1 || unit.begin >= unit.end || unit.end > Limits::max_iterations) {
    return refused_error("the delta holds no iterations").with_field("unit");
  }
  Half& half = halves_[unit.half];
  if (half.merged.intersects(unit.begin, unit.end)) return overlap_error(unit.half, unit.begin, unit.end);
  const auto tallies = sum_of(half.tallies, delta.tallies_);
  if (!tallies) return refused_error("the delta's counts are impossibly large").with_field("tallies");

  std::array<std::uint64_t, kTileSize * kTileSize> codes;
  std::array<std::int64_t, kTileSize * kTileSize * kChannels> values;
  for (const Delta::Group& group : delta.groups_) {
    std::size_t offset = 0;
    for (std::size_t t = group.first; t < group.first + group.count; ++t) {
      const std::uint32_t tile = delta.tiles_[t];
      const std::size_t pixels = tile_rect(layout_, tile).pixels();
      for (std::size_t c = 0; c < kChannels; ++c) {
        expand_low(group.channels[c], offset, std::span(codes).first(pixels));
        std::int64_t* to = values.data() + c * pixels;
        for (std::size_t i = 0; i < pixels; ++i) to[i] = unzigzag(codes[i]);
      }
      add_tile(half.tiles[tile], std::span<const std::int64_t>(values).first(pixels * kChannels));
      offset += pixels;
    }
  }
  half.tallies = *tallies;
  half.merged.insert(unit.begin, unit.end);
  return {};
}

Result<void> MergedFilm::merge(const MergedFilm& other) {
  if (other.layout_ != layout_ || other.scale_log2_ != scale_log2_) {
    return refused_error("the films differ in layout or scale").with_field("layout");
  }
  std::array<Tallies, 2> tallies;
  for (std::uint32_t h = 0; h < 2; ++h) {
    for (const auto& [begin, end] : other.halves_[h].merged.ranges()) {
      if (halves_[h].merged.intersects(begin, end)) return overlap_error(h, begin, end);
    }
    const auto sum = sum_of(halves_[h].tallies, other.halves_[h].tallies);
    if (!sum) return refused_error("the films' counts are impossibly large").with_field("tallies");
    tallies[h] = *sum;
  }
  if (&other == this) return {};  // only reached if it is empty
  for (std::uint32_t h = 0; h < 2; ++h) {
    Half& half = halves_[h];
    for (std::size_t tile = 0; tile < half.tiles.size(); ++tile) {
      const TileSums& from = other.halves_[h].tiles[tile];
      if (!from.wide.empty()) {
        add_tile(half.tiles[tile], std::span<const Int128>(from.wide));
      } else if (!from.narrow.empty()) {
        add_tile(half.tiles[tile], std::span<const std::int64_t>(from.narrow));
      }
    }
    half.tallies = tallies[h];
    for (const auto& [begin, end] : other.halves_[h].merged.ranges()) half.merged.insert(begin, end);
  }
  return {};
}

MergedFilm MergedFilm::first_layers(std::uint32_t count) const {
  MergedFilm image({layout_.width, layout_.height, std::min(count, layout_.layers)}, scale_log2_);
  for (std::size_t h = 0; h < 2; ++h) {
    Half& to = image.halves_[h];
    const Half& from = halves_[h];
    std::copy_n(from.tiles.begin(), to.tiles.size(), to.tiles.begin());  // layer after layer
    to.merged = from.merged;
    to.tallies = from.tallies;
  }
  return image;
}

bool MergedFilm::black(std::uint32_t layers) const {
  const auto zero = [](const auto& sums) {
    return std::all_of(sums.begin(), sums.end(), [](auto value) { return value == 0; });
  };
  const Layout first{layout_.width, layout_.height, std::min(layers, layout_.layers)};
  return std::all_of(halves_.begin(), halves_.end(), [&](const Half& half) {
    return std::all_of(half.tiles.begin(),
                       half.tiles.begin() + static_cast<std::ptrdiff_t>(first.tile_count()),
                       [&](const TileSums& tile) { return zero(tile.narrow) && zero(tile.wide); });
  });
}

Int128 MergedFilm::sum(std::uint32_t half, std::uint32_t layer, std::uint32_t x, std::uint32_t y,
                       int channel) const {
  const Place at = place(layout_, layer, x, y);
  const TileSums& tile = halves_[half].tiles[at.tile];
  const std::size_t index = static_cast<std::size_t>(channel) * at.pixels + at.offset;
  if (!tile.wide.empty()) return tile.wide[index];
  if (!tile.narrow.empty()) return tile.narrow[index];
  return 0;
}

void MergedFilm::develop_row(std::uint32_t layer, std::uint32_t y, Which which, std::span<double> out) const {
  const bool first = which != Which::half1;
  const bool second = which != Which::half0;
  const std::uint64_t count =
      (first ? halves_[0].merged.count() : 0) + (second ? halves_[1].merged.count() : 0);
  if (count == 0) {
    std::fill(out.begin(), out.end(), 0.0);
    return;
  }
  const TileSums none;
  const double divisor = static_cast<double>(count);
  const double value_per_unit = std::ldexp(1.0, -scale_log2_);
  // Integer to double rounds to nearest whether it comes from 64 or from 128 bits.
  const auto mean = [&](double sum) { return sum / divisor * value_per_unit; };
  for (std::uint32_t x = 0; x < layout_.width; x += kTileSize) {
    const Place at = place(layout_, layer, x, y);
    const std::uint32_t width = std::min<std::uint32_t>(kTileSize, layout_.width - x);
    const TileSums& a = first ? halves_[0].tiles[at.tile] : none;
    const TileSums& b = second ? halves_[1].tiles[at.tile] : none;
    for (std::size_t c = 0; c < kChannels; ++c) {
      const std::size_t index = c * at.pixels + at.offset;
      double* to = out.data() + std::size_t{x} * kChannels + c;
      if (a.wide.empty() && b.wide.empty()) {
        for (std::uint32_t i = 0; i < width; ++i) {
          const std::int64_t sum_a = a.narrow.empty() ? 0 : a.narrow[index + i];
          const std::int64_t sum_b = b.narrow.empty() ? 0 : b.narrow[index + i];
          std::int64_t sum = 0;
          to[i * kChannels] = __builtin_add_overflow(sum_a, sum_b, &sum)
                                  ? mean(static_cast<double>(Int128{sum_a} + sum_b))
                                  : mean(static_cast<double>(sum));
        }
      } else {
        const auto get = [&](const TileSums& tile, std::size_t i) -> Int128 {
          if (!tile.wide.empty()) return tile.wide[i];
          return tile.narrow.empty() ? 0 : tile.narrow[i];
        };
        for (std::uint32_t i = 0; i < width; ++i) {
          to[i * kChannels] = mean(static_cast<double>(get(a, index + i) + get(b, index + i)));
        }
      }
    }
  }
}

std::vector<float> MergedFilm::develop(std::uint32_t layer, Which which) const {
  const std::size_t row_values = std::size_t{layout_.width} * kChannels;
  std::vector<float> image(row_values * layout_.height);
  std::vector<double> row(row_values);
  for (std::uint32_t y = 0; y < layout_.height; ++y) {
    develop_row(layer, y, which, row);
    float* to = image.data() + y * row_values;
    for (std::size_t i = 0; i < row_values; ++i) to[i] = static_cast<float>(row[i]);
  }
  return image;
}

void MergedFilm::serialise_half(std::string& out, const Half& half) const {
  put_u64(out, half.merged.ranges().size());
  for (const auto& [begin, end] : half.merged.ranges()) {
    put_u64(out, begin);
    put_u64(out, end);
  }
  put_tallies(out, half.tallies);
  std::vector<std::uint32_t> tiles;
  const auto not_zero = [](const auto& sums) {
    return std::any_of(sums.begin(), sums.end(), [](auto value) { return value != 0; });
  };
  for (std::size_t tile = 0; tile < half.tiles.size(); ++tile) {
    const TileSums& sums = half.tiles[tile];
    if (not_zero(sums.narrow) || not_zero(sums.wide)) tiles.push_back(static_cast<std::uint32_t>(tile));
  }
  put_tiles(out, tiles);

  PlaneWriter writer;
  std::vector<std::uint64_t> low, high;
  for (std::size_t first = 0; first < tiles.size(); first += kGroupTiles) {
    const std::size_t last = std::min(tiles.size(), first + kGroupTiles);
    for (std::size_t c = 0; c < kChannels; ++c) {
      low.clear();
      high.clear();
      for (std::size_t t = first; t < last; ++t) {
        const TileSums& sums = half.tiles[tiles[t]];
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

std::string MergedFilm::serialise() const {
  std::string out(kMagic);
  put_layout(out, layout_, scale_log2_);
  for (const Half& half : halves_) serialise_half(out, half);
  seal(out);
  return out;
}

Result<void> MergedFilm::parse_half(std::string_view& rest, Half& half) const {
  Reader reader(rest);
  const std::uint64_t ranges = reader.u64();
  std::uint64_t next = 0;  // the lowest index the next range may begin with
  for (std::uint64_t i = 0; i < ranges; ++i) {
    const std::uint64_t begin = reader.u64();
    const std::uint64_t end = reader.u64();
    if (!reader.ok()) return input_error("the film's list of iterations ends too early").with_field("merged");
    if (begin < next || begin >= end || end > Limits::max_iterations || !half.merged.insert(begin, end)) {
      return input_error("the film's ranges of iterations are out of order").with_field("merged");
    }
    next = end + 1;
  }
  half.tallies = read_tallies(reader);
  CANDELA_ASSIGN(const std::vector<std::uint32_t> tiles, read_tiles(reader, layout_.tile_count()));
  const Uint128 bound = static_cast<Uint128>(half.merged.count()) << 63;

  PlaneReader planes;
  std::vector<std::uint64_t> low(kTileSize * kTileSize), high(kTileSize * kTileSize);
  std::vector<Int128> wide;
  for (std::size_t first = 0; first < tiles.size(); first += kGroupTiles) {
    const std::size_t last = std::min(tiles.size(), first + kGroupTiles);
    std::size_t values = 0;
    for (std::size_t t = first; t < last; ++t) values += tile_rect(layout_, tiles[t]).pixels();
    std::array<PlaneSet, kChannels> channels;
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
          if (value > static_cast<Int128>(bound) || value < -static_cast<Int128>(bound)) {
            return input_error("a sum of the film is larger than its iterations allow").with_field("tiles");
          }
          zero &= value == 0;
          fits &= value == static_cast<std::int64_t>(value);
          wide.push_back(value);
        }
      }
      if (zero) return input_error("the film lists a tile that is all zero").with_field("tiles");
      TileSums& sums = half.tiles[tiles[t]];
      if (fits) {
        sums.narrow.reserve(wide.size());
        for (const Int128 value : wide) sums.narrow.push_back(static_cast<std::int64_t>(value));
      } else {
        sums.wide = wide;
      }
      offset += pixels;
    }
  }
  if (!reader.ok()) return input_error("the film ends too early").with_field("length");
  rest = reader.rest();
  return {};
}

Result<MergedFilm> MergedFilm::parse(std::string_view bytes) {
  CANDELA_ASSIGN(const std::string_view content, unseal(bytes, kMagic, "the film"));
  Reader reader(content);
  Layout layout;
  layout.width = reader.u32();
  layout.height = reader.u32();
  layout.layers = reader.u32();
  const int scale_log2 = static_cast<std::int32_t>(reader.u32());
  if (!reader.ok()) return input_error("the film ends in its header").with_field("length");
  CANDELA_TRY(validate(layout, scale_log2));
  MergedFilm film(layout, scale_log2);
  std::string_view rest = reader.rest();
  for (Half& half : film.halves_) CANDELA_TRY(film.parse_half(rest, half));
  if (!rest.empty()) {
    return input_error("the film has " + std::to_string(rest.size()) + " bytes too many")
        .with_field("length");
  }
  return film;
}

}  // namespace candela::film
