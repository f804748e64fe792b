// The accumulator of one unit, and the small shared parts of films.
#include "common/film/film.h"

namespace candela::film {

std::string_view name(RejectCause cause) {
  switch (cause) {
    case RejectCause::not_a_number:
      return "nan";
    case RejectCause::infinite:
      return "infinite";
    case RejectCause::negative:
      return "negative";
    case RejectCause::saturated:
      return "saturated";
  }
  return "unknown";
}

void Tallies::add(const Tallies& other) {
  eye_samples += other.eye_samples;
  light_paths += other.light_paths;
  rays += other.rays;
  for (std::size_t i = 0; i < rejected.size(); ++i) rejected[i] += other.rejected[i];
}

Result<void> validate(const Layout& layout, int scale_log2) {
  if (layout.width == 0 || layout.height == 0 || layout.width > Limits::max_extent ||
      layout.height > Limits::max_extent || layout.pixel_count() > Limits::max_pixels) {
    return input_error("a film of " + std::to_string(layout.width) + " x " + std::to_string(layout.height) +
                       " pixels is not possible")
        .with_field("layout")
        .with_mend("use 1 to " + std::to_string(Limits::max_extent) + " pixels a side and at most " +
                   std::to_string(Limits::max_pixels) + " together");
  }
  if (layout.layers == 0 || layout.layers > kMaxLayers ||
      layout.pixel_count() * layout.layers > kMaxLayerPixels) {
    return input_error("a film of " + std::to_string(layout.layers) + " layers is not possible")
        .with_field("layers")
        .with_mend("use 1 to " + std::to_string(kMaxLayers) + " layers, fewer for very large films");
  }
  if (scale_log2 < -kMaxScaleLog2 || scale_log2 > kMaxScaleLog2) {
    return input_error("a film scale of 2^" + std::to_string(scale_log2) + " is not possible")
        .with_field("film_scale_log2")
        .with_mend("use -" + std::to_string(kMaxScaleLog2) + " to " + std::to_string(kMaxScaleLog2));
  }
  return {};
}

int scale_log2_for(double mean_luminance) {
  constexpr int kMeanLog2 = 20;
  int exponent = 0;
  std::frexp(mean_luminance, &exponent);
  return std::clamp(kMeanLog2 - exponent, -126, 126);
}

TileRect tile_rect(const Layout& layout, std::size_t tile_index) {
  const std::size_t per_layer = std::size_t{layout.tiles_x()} * layout.tiles_y();
  const std::size_t in_layer = tile_index % per_layer;
  TileRect rect{};
  rect.layer = static_cast<std::uint32_t>(tile_index / per_layer);
  rect.x = static_cast<std::uint32_t>(in_layer % layout.tiles_x()) * kTileSize;
  rect.y = static_cast<std::uint32_t>(in_layer / layout.tiles_x()) * kTileSize;
  rect.width = std::min<std::uint32_t>(kTileSize, layout.width - rect.x);
  rect.height = std::min<std::uint32_t>(kTileSize, layout.height - rect.y);
  return rect;
}

UnitFilm::UnitFilm(Layout layout, int scale_log2)
    : layout_(layout),
      scale_log2_(scale_log2),
      units_per_value_(std::ldexp(1.0, scale_log2)),
      limit_bits_(std::bit_cast<std::uint32_t>(static_cast<float>(
          std::min<double>(kMaxContribution / units_per_value_, std::numeric_limits<float>::max())))),
      tiles_x_(layout.tiles_x()),
      tiles_y_(layout.tiles_y()),
      sums_(layout.pixel_count() * layout.layers * kChannels),
      touched_(layout.tile_count()) {}

bool UnitFilm::admit(const std::array<float, kChannels>& rgb, Tallies& tallies, bool signed_values) const {
  // The classes by bits, so that they hold under any treatment of denormals.
  bool is_nan = false, is_infinite = false, is_negative = false, is_saturated = false;
  for (const float value : rgb) {
    const std::uint32_t bits = std::bit_cast<std::uint32_t>(value);
    const std::uint32_t magnitude = bits & 0x7fffffffU;
    is_nan |= magnitude > 0x7f800000U;
    is_infinite |= magnitude == 0x7f800000U;
    is_negative |= !signed_values && magnitude != bits && magnitude != 0;
    is_saturated |= magnitude > limit_bits_;
  }
  const auto reject = [&](RejectCause cause) {
    ++tallies.rejected[static_cast<std::size_t>(cause)];
    return false;
  };
  if (is_nan) return reject(RejectCause::not_a_number);
  if (is_infinite) return reject(RejectCause::infinite);
  if (is_negative) return reject(RejectCause::negative);
  if (is_saturated) return reject(RejectCause::saturated);
  return true;  // a negative zero
}

void UnitFilm::count(const Tallies& tallies) {
  while (lock_.test_and_set(std::memory_order_acquire)) {
  }
  tallies_.add(tallies);
  lock_.clear(std::memory_order_release);
}

Tallies UnitFilm::tallies() const {
  while (lock_.test_and_set(std::memory_order_acquire)) {
  }
  const Tallies copy = tallies_;
  lock_.clear(std::memory_order_release);
  return copy;
}

void UnitFilm::clear() {
  for (std::size_t tile = 0; tile < touched_.size(); ++tile) {
    if (touched_[tile] == 0) continue;
    const TileRect rect = tile_rect(layout_, tile);
    for (std::uint32_t y = rect.y; y < rect.y + rect.height; ++y) {
      std::fill_n(pixel(rect.layer, rect.x, y), std::size_t{rect.width} * kChannels, 0);
    }
    touched_[tile] = 0;
  }
  overflowed_.store(false, std::memory_order_relaxed);
  tallies_ = {};
}

bool IndexSet::insert(std::uint64_t begin, std::uint64_t end) {
  if (begin >= end || intersects(begin, end)) return false;
  auto next = ranges_.lower_bound(begin);
  // Neighbours are joined, so that equal sets have equal ranges however they grew.
  if (next != ranges_.end() && next->first == end) {
    end = next->second;
    next = ranges_.erase(next);
  }
  if (next != ranges_.begin() && std::prev(next)->second == begin) {
    std::prev(next)->second = end;
  } else {
    ranges_.emplace_hint(next, begin, end);
  }
  return true;
}

bool IndexSet::intersects(std::uint64_t begin, std::uint64_t end) const {
  if (begin >= end) return false;
  const auto next = ranges_.lower_bound(begin);
  if (next != ranges_.end() && next->first < end) return true;
  return next != ranges_.begin() && std::prev(next)->second > begin;
}

std::uint64_t IndexSet::count() const {
  std::uint64_t total = 0;
  for (const auto& [begin, end] : ranges_) total += end - begin;
  return total;
}

std::pair<std::uint64_t, std::uint64_t> IndexSet::first_gap(std::uint64_t from, std::uint64_t limit) const {
  auto next = ranges_.upper_bound(from);
  if (next != ranges_.begin() && std::prev(next)->second > from) {
    from = std::prev(next)->second;  // ranges never touch, so a gap begins here
  }
  if (from >= limit) return {limit, limit};
  const std::uint64_t end = next == ranges_.end() ? limit : std::min(limit, next->first);
  return {from, end};
}

}  // namespace candela::film
