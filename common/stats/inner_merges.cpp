#include "common/stats/inner_merges.h"

#include <algorithm>
#include <cmath>

#include "common/rng/stream.h"

namespace candela::stats {
namespace {

// Bias of an image over the difference: of one that goes as the radius, as most of the bias of photons does,
// which lies along edges. One that goes as its square is overestimated by a half.
constexpr double kBiasOverDifference = 2;
constexpr std::uint64_t kWord = 0x696e6e6572;  // "inner"

std::uint32_t blocks_of(std::uint32_t pixels, std::uint32_t side) {
  return (pixels + side - 1) / side;
}

}  // namespace

film::AccumulatorSpec inner_merges_spec(std::uint32_t width, std::uint32_t height, int film_scale_log2) {
  const std::uint32_t side = block_side(std::max(width, 1U), std::max(height, 1U));
  film::AccumulatorSpec spec;
  spec.name = kInnerMerges;
  spec.channels = film::kChannels;
  spec.scale_log2 = film_scale_log2;
  spec.domain = film::AccumulatorSpec::Domain::table;
  spec.entries = std::max(1U, blocks_of(width, side) * blocks_of(height, side));
  return spec;
}

film::UnitAccumulator* find_inner_merges(std::span<const std::unique_ptr<film::UnitAccumulator>> of_unit) {
  for (const auto& sums : of_unit)
    if (sums->spec().name == kInnerMerges) return sums.get();
  return nullptr;
}

void add_inner_merges(film::UnitAccumulator& to, std::uint32_t width, std::uint32_t height, std::uint32_t x,
                      std::uint32_t y, const std::array<double, film::kChannels>& difference,
                      std::uint64_t key) {
  if (difference == std::array<double, film::kChannels>{}) return;
  const std::uint32_t side = block_side(width, height);
  const film::TablePlace place = film::place_of_entry(y / side * blocks_of(width, side) + x / side);
  film::SampleCounts ignored;
  const std::uint64_t own_key = rng::combine(key, kWord);
  if (side == 1)
    to.add(place.x, place.y, 0, difference, own_key, ignored);
  else  // threads share blocks
    to.splat(place.x, place.y, 0, difference, own_key, ignored);
}

Movement::Bias measured_bias(const std::array<const film::MergedAccumulator*, 2>& halves, std::uint32_t width,
                             std::uint32_t height, double n0, double n1) {
  Movement::Bias bias;
  if (halves[0] == nullptr || halves[1] == nullptr || !(n0 > 0) || !(n1 > 0)) return bias;
  const std::uint32_t side = block_side(width, height), columns = blocks_of(width, side),
                      rows = blocks_of(height, side);
  for (std::size_t h = 0; h < 2; ++h) {
    const film::MergedAccumulator& sums = *halves[h];
    const double value = std::ldexp(kBiasOverDifference / (h == 0 ? n0 : n1), -sums.spec().scale_log2);
    std::vector<float>& out = h == 0 ? bias.a : bias.b;
    for (std::uint32_t block = 0; block < rows * columns; ++block) {
      const std::uint32_t x = block % columns * side, y = block / columns * side;
      const double pixels = static_cast<double>(std::min(side, width - x) * std::min(side, height - y));
      const film::TablePlace place = film::place_of_entry(block);
      for (std::uint32_t c = 0; c < film::kChannels; ++c)
        out.push_back(
            static_cast<float>(static_cast<double>(sums.sum(place.x, place.y, c)) * value / pixels));
    }
  }
  return bias;
}

}  // namespace candela::stats
