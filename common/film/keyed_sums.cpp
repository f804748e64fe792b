#include "common/film/keyed_sums.h"

#include <algorithm>
#include <new>
#include <unordered_map>

#include "common/base/mutex.h"

namespace candela::film {
namespace {

Int128 value_at(const TileSums::Tile& sums, std::size_t i) {
  return sums.wide.empty() ? Int128{sums.narrow[i]} : sums.wide[i];
}

constexpr std::uint32_t pixel_of(std::uint64_t place) {
  return static_cast<std::uint32_t>(place >> 32);
}
constexpr std::uint32_t key_of(std::uint64_t place) {
  return static_cast<std::uint32_t>(place);
}

// Calls visit(index in `to`, index in `from`) for each pair of `from`. Precondition: `to` has all of them.
template <class Visit>
void for_each_pair(const KeyedSums::Tile& to, const KeyedSums::Tile& from, const Visit& visit) {
  std::size_t t = 0;
  for (std::size_t f = 0; f < from.places.size(); ++f) {
    while (to.places[t] != from.places[f]) ++t;
    visit(t, f);
  }
}

// Makes places for those of `from`. If memory runs out nothing changes.
void reserve_tile(KeyedSums::Tile& to, const KeyedSums::Tile& from) {
  if (std::includes(to.places.begin(), to.places.end(), from.places.begin(), from.places.end())) return;
  KeyedSums::Tile all;
  all.places.reserve(to.places.size() + from.places.size());
  std::set_union(to.places.begin(), to.places.end(), from.places.begin(), from.places.end(),
                 std::back_inserter(all.places));
  all.places.shrink_to_fit();
  const bool wide = !to.sums.wide.empty();
  if (wide)
    all.sums.wide.resize(all.places.size());
  else
    all.sums.narrow.resize(all.places.size());
  for_each_pair(all, to, [&](std::size_t a, std::size_t t) {
    if (wide)
      all.sums.wide[a] = to.sums.wide[t];
    else
      all.sums.narrow[a] = to.sums.narrow[t];
  });
  to = std::move(all);
}

// Precondition: reserve_tile().
void add_tile(KeyedSums::Tile& to, const KeyedSums::Tile& from) {
  if (from.places.empty()) return;
  if (to.sums.wide.empty()) {
    bool fits = from.sums.wide.empty();
    if (fits)
      for_each_pair(to, from, [&](std::size_t t, std::size_t f) {
        std::int64_t sum = 0;
        fits &= !__builtin_add_overflow(to.sums.narrow[t], from.sums.narrow[f], &sum);
      });
    if (!fits) to.sums.widen();
  }
  const bool wide = !to.sums.wide.empty();
  for_each_pair(to, from, [&](std::size_t t, std::size_t f) {
    if (wide)
      to.sums.wide[t] += value_at(from.sums, f);
    else
      to.sums.narrow[t] += from.sums.narrow[f];
  });
}

void subtract_tile(KeyedSums::Tile& to, const KeyedSums::Tile& from) {
  const bool wide = !to.sums.wide.empty();
  for_each_pair(to, from, [&](std::size_t t, std::size_t f) {
    if (wide)
      to.sums.wide[t] -= value_at(from.sums, f);
    else
      to.sums.narrow[t] -= from.sums.narrow[f];
  });
  std::size_t kept = 0;
  for (std::size_t t = 0; t < to.places.size(); ++t) {
    if (value_at(to.sums, t) == 0) continue;
    to.places[kept] = to.places[t];
    if (wide)
      to.sums.wide[kept] = to.sums.wide[t];
    else
      to.sums.narrow[kept] = to.sums.narrow[t];
    ++kept;
  }
  to.places.erase(to.places.begin() + static_cast<std::ptrdiff_t>(kept), to.places.end());
  if (wide)
    to.sums.wide.erase(to.sums.wide.begin() + static_cast<std::ptrdiff_t>(kept), to.sums.wide.end());
  else
    to.sums.narrow.erase(to.sums.narrow.begin() + static_cast<std::ptrdiff_t>(kept), to.sums.narrow.end());
}

std::uint64_t union_size(const std::vector<std::uint64_t>& a, const std::vector<std::uint64_t>& b) {
  std::uint64_t count = 0;
  for (std::size_t i = 0, j = 0; i < a.size() || j < b.size(); ++count) {
    const bool from_a = j == b.size() || (i < a.size() && a[i] <= b[j]);
    const bool from_b = i == a.size() || (j < b.size() && b[j] <= a[i]);
    i += from_a ? 1 : 0;
    j += from_b ? 1 : 0;
  }
  return count;
}

}  // namespace

std::uint64_t KeyedSums::pairs_with(const KeyedSums& other) const {
  std::uint64_t count = 0;
  for (std::size_t tile = 0; tile < tiles_.size(); ++tile) {
    const std::vector<std::uint64_t>&mine = tiles_[tile].places, &theirs = other.tiles_[tile].places;
    count += theirs.empty() ? mine.size() : union_size(mine, theirs);  // a delta may bring few tiles
  }
  return count;
}

void KeyedSums::reserve(const KeyedSums& other) {
  for (std::size_t tile = 0; tile < tiles_.size(); ++tile) reserve_tile(tiles_[tile], other.tiles_[tile]);
}

void KeyedSums::add(const KeyedSums& other) {
  reserve(other);
  std::size_t next = 0;  // the first tile that is not added
  try {
    for (; next < tiles_.size(); ++next) add_tile(tiles_[next], other.tiles_[next]);
  } catch (const std::bad_alloc&) {
    while (next-- > 0) subtract_tile(tiles_[next], other.tiles_[next]);
    throw;
  }
}

void KeyedSums::subtract(const KeyedSums& other) {
  for (std::size_t tile = 0; tile < tiles_.size(); ++tile) subtract_tile(tiles_[tile], other.tiles_[tile]);
}

void KeyedSums::set_tile(std::size_t tile, std::span<const std::pair<std::uint64_t, std::int64_t>> places) {
  Tile& to = tiles_[tile];
  to.places.reserve(places.size());
  to.sums.narrow.reserve(places.size());
  for (const auto& [place, sum] : places) {
    to.places.push_back(place);
    to.sums.narrow.push_back(sum);
  }
}

void KeyedSums::get_pixel(std::uint32_t x, std::uint32_t y, std::vector<KeySum>& out) const {
  out.clear();
  if (tiles_.empty()) return;
  const TilePlace at = tile_place(layout_, 0, x, y);
  const Tile& tile = tiles_[at.tile];
  const auto first = std::lower_bound(tile.places.begin(), tile.places.end(), std::uint64_t{at.offset} << 32);
  for (auto i = first; i != tile.places.end() && pixel_of(*i) == at.offset; ++i)
    out.push_back({key_of(*i), value_at(tile.sums, static_cast<std::size_t>(i - tile.places.begin()))});
}

std::uint64_t KeyedSums::pairs() const {
  std::uint64_t count = 0;
  for (const Tile& tile : tiles_) count += tile.places.size();
  return count;
}

std::uint64_t KeyedSums::memory_bytes() const {
  std::uint64_t bytes = 0;
  for (const Tile& tile : tiles_)
    bytes += tile.places.size() * sizeof(std::uint64_t) + tile.sums.narrow.size() * sizeof(std::int64_t) +
             tile.sums.wide.size() * sizeof(Int128);
  return bytes;
}

void KeyedSums::put(std::string& out) const {
  std::vector<std::uint32_t> tiles;
  for (std::size_t tile = 0; tile < tiles_.size(); ++tile)
    if (!tiles_[tile].sums.zero()) tiles.push_back(static_cast<std::uint32_t>(tile));
  put_tiles(out, tiles);

  PlaneWriter writer;
  std::vector<std::uint64_t> pixels, keys, low, high;
  for (std::size_t first = 0; first < tiles.size(); first += kGroupTiles) {
    const std::size_t last = std::min(tiles.size(), first + kGroupTiles);
    for (std::vector<std::uint64_t>* const list : {&pixels, &keys, &low, &high}) list->clear();
    for (std::size_t t = first; t < last; ++t) {
      const Tile& tile = tiles_[tiles[t]];
      const std::size_t before = keys.size();
      std::uint64_t pixel = 0;
      for (std::size_t i = 0; i < tile.places.size(); ++i) {
        const Int128 value = value_at(tile.sums, i);
        if (value == 0) continue;
        const Uint128 code = (static_cast<Uint128>(value) << 1) ^ static_cast<Uint128>(value >> 127);
        pixels.push_back(pixel_of(tile.places[i]) - pixel);
        pixel = pixel_of(tile.places[i]);
        keys.push_back(key_of(tile.places[i]));
        low.push_back(static_cast<std::uint64_t>(code));
        high.push_back(static_cast<std::uint64_t>(code >> 64));
      }
      put_u32(out, static_cast<std::uint32_t>(keys.size() - before));
    }
    writer.put(out, pixels, {});
    writer.put(out, keys, {});
    writer.put(out, low, high);
  }
}

Result<KeyedSums> KeyedSums::read(Reader& reader, const Layout& layout, std::uint32_t keys,
                                  std::uint64_t max_pairs, Uint128 bound, std::string_view what) {
  const auto bad = [&](std::string_view text) {
    return input_error(std::string(what) + " " + std::string(text)).with_field("tiles");
  };
  KeyedSums sums(layout);
  CANDELA_ASSIGN(const std::vector<std::uint32_t> tiles, read_tiles(reader, layout.tile_count()));
  PlaneReader planes;
  std::vector<std::uint64_t> steps, key_codes, low, high;
  std::uint64_t pairs = 0;
  for (std::size_t first = 0; first < tiles.size(); first += kGroupTiles) {
    const std::size_t last = std::min(tiles.size(), first + kGroupTiles);
    std::vector<std::uint32_t> counts;
    std::uint64_t count = 0;
    for (std::size_t t = first; t < last; ++t) {
      counts.push_back(reader.u32());
      count += counts.back();
    }
    pairs += count;
    if (!reader.ok() || pairs > max_pairs) return bad("has more pairs of pixel and key than a job may have");
    CANDELA_ASSIGN(const PlaneSet step_planes, planes.read(reader, count, 2));
    CANDELA_ASSIGN(const PlaneSet key_planes, planes.read(reader, count, 4));
    CANDELA_ASSIGN(const PlaneSet sum_planes, planes.read(reader, count, PlaneSet::kMaxPlanes));
    std::size_t offset = 0;
    for (std::size_t t = first; t < last; ++t) {
      const std::size_t size = counts[t - first];
      if (size == 0) return bad("lists a tile that has no sums");
      // Before memory is taken: a count costs the sender nothing.
      if (size > tile_rect(layout, tiles[t]).pixels() * keys) return bad("has too many pairs in a tile");
      for (std::vector<std::uint64_t>* const list : {&steps, &key_codes, &low, &high}) list->resize(size);
      expand_low(step_planes, offset, steps);
      expand_low(key_planes, offset, key_codes);
      expand_low(sum_planes, offset, low);
      expand_high(sum_planes, offset, high);
      offset += size;
      Tile& tile = sums.tiles_[tiles[t]];
      tile.places.reserve(size);
      std::vector<Int128> wide;
      wide.reserve(size);
      bool fits = true;
      std::uint64_t pixel = 0;
      for (std::size_t i = 0; i < size; ++i) {
        pixel += steps[i];
        const std::uint64_t place = pixel << 32 | key_codes[i];
        if (pixel >= tile_rect(layout, tiles[t]).pixels() || key_codes[i] >= keys ||
            (i > 0 && place <= tile.places.back()))
          return bad("has pairs of pixel and key out of order");
        const Uint128 code = (static_cast<Uint128>(high[i]) << 64) | low[i];
        const auto value = static_cast<Int128>((code >> 1) ^ (~(code & 1) + 1));
        if (value == 0 || value > static_cast<Int128>(bound) || value < -static_cast<Int128>(bound))
          return bad("has a sum that is 0 or larger than its iterations allow");
        fits &= value == static_cast<std::int64_t>(value);
        tile.places.push_back(place);
        wide.push_back(value);
      }
      if (!fits) {
        tile.sums.wide = std::move(wide);
        continue;
      }
      tile.sums.narrow.reserve(size);
      for (const Int128 value : wide) tile.sums.narrow.push_back(static_cast<std::int64_t>(value));
    }
  }
  if (!reader.ok()) return input_error(std::string(what) + " ends too early").with_field("length");
  return sums;
}

void KeyedSums::hash_into(Sha256& hash) const {
  std::string fields;
  for (std::size_t t = 0; t < tiles_.size(); ++t) {
    const Tile& tile = tiles_[t];
    fields.clear();
    for (std::size_t i = 0; i < tile.places.size(); ++i) {
      const auto value = static_cast<Uint128>(value_at(tile.sums, i));
      if (value == 0) continue;
      put_u32(fields, static_cast<std::uint32_t>(t));
      put_u64(fields, tile.places[i]);
      put_u64(fields, static_cast<std::uint64_t>(value));
      put_u64(fields, static_cast<std::uint64_t>(value >> 64));
    }
    hash.update(fields);
  }
  fields.clear();
  put_u64(fields, tiles_.size());
  hash.update(fields);
}

struct UnitKeys::Tile {
  Mutex mutex;
  std::unordered_map<std::uint64_t, std::int64_t> sums CANDELA_GUARDED_BY(mutex);  // by place
};

UnitKeys::UnitKeys() = default;
UnitKeys::UnitKeys(const Layout& layout) : layout_(layout) {
  tiles_.reserve(layout.tile_count());
  for (std::size_t i = 0; i < layout.tile_count(); ++i) tiles_.push_back(std::make_unique<Tile>());
}
UnitKeys::~UnitKeys() = default;
UnitKeys::UnitKeys(UnitKeys&&) noexcept = default;
UnitKeys& UnitKeys::operator=(UnitKeys&&) noexcept = default;

bool UnitKeys::add(std::uint32_t x, std::uint32_t y, std::uint32_t key, std::int64_t units) {
  const TilePlace at = tile_place(layout_, 0, x, y);
  Tile& tile = *tiles_[at.tile];
  const Lock lock(tile.mutex);
  std::int64_t& sum = tile.sums[std::uint64_t{at.offset} << 32 | key];
  return __builtin_add_overflow(sum, units, &sum);
}

KeyedSums UnitKeys::sums() const {
  KeyedSums out(layout_);
  std::vector<std::pair<std::uint64_t, std::int64_t>> places;
  for (std::size_t t = 0; t < tiles_.size(); ++t) {
    const Lock lock(tiles_[t]->mutex);
    places.assign(tiles_[t]->sums.begin(), tiles_[t]->sums.end());
    std::sort(places.begin(), places.end());
    out.set_tile(t, places);
  }
  return out;
}

std::uint64_t UnitKeys::pairs() const {
  std::uint64_t count = 0;
  for (const auto& tile : tiles_) {
    const Lock lock(tile->mutex);
    count += tile->sums.size();
  }
  return count;
}

void UnitKeys::clear() {
  for (const auto& tile : tiles_) {
    const Lock lock(tile->mutex);
    tile->sums.clear();
  }
}

}  // namespace candela::film
