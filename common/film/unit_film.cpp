#include "common/film/unit_film.h"

#include <cmath>
#include <limits>

#include "common/film/sparse_sums.h"

namespace candela::film {

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

bool UnitFilm::admit(const std::array<float, kChannels>& rgb, SampleCounts& sample_counts,
                     bool signed_values) const {
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
    ++sample_counts.rejected[static_cast<std::size_t>(cause)];
    return false;
  };
  if (is_nan) return reject(RejectCause::not_a_number);
  if (is_infinite) return reject(RejectCause::infinite);
  if (is_negative) return reject(RejectCause::negative);
  if (is_saturated) return reject(RejectCause::saturated);
  return true;  // a negative zero
}

void UnitFilm::count(const SampleCounts& sample_counts) {
  while (lock_.test_and_set(std::memory_order_acquire)) {
  }
  sample_counts_.add(sample_counts);
  lock_.clear(std::memory_order_release);
}

SampleCounts UnitFilm::sample_counts() const {
  while (lock_.test_and_set(std::memory_order_acquire)) {
  }
  const SampleCounts copy = sample_counts_;
  lock_.clear(std::memory_order_release);
  return copy;
}

void UnitFilm::put_sums(std::string& out) const {
  film::put_sums(out, layout_, kChannels, sums_, touched_);
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
  sample_counts_ = {};
}

}  // namespace candela::film
