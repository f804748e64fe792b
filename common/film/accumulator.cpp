#include "common/film/accumulator.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <utility>

#include "common/film/accumulator_add.h"
#include "common/film/codec.h"
#include "common/film/layers.h"
#include "common/film/quantise.h"
#include "common/film/sparse_sums.h"

namespace candela::film {
namespace {

using namespace adding;

Error spec_error(const AccumulatorSpec& spec, std::string_view text) {
  return input_error("accumulator '" + spec.name + "': " + std::string(text)).with_field("accumulators");
}

using AddIfWithin = Added (*)(std::int64_t*, const double*, double, double, std::uint64_t);

// By the number of channels.
template <std::size_t... kCounts>
constexpr std::array<AddIfWithin, kMaxChunk> adders(std::index_sequence<kCounts...>) {
  return {&add_if_within<kCounts + 1>...};
}
constexpr std::array<AddIfWithin, kMaxChunk> kAdders = adders(std::make_index_sequence<kMaxChunk>());

// |sum| of at most 2^40 indices, each of 64 bits.
constexpr Uint128 kMaxSum = static_cast<Uint128>(1) << 103;

// The cause of rejection of values that are not all within the limit.
RejectCause reject_cause(std::span<const double> values) {
  bool is_infinite = false;
  for (const double value : values) {
    if (std::isnan(value)) return RejectCause::not_a_number;
    is_infinite |= std::isinf(value);
  }
  return is_infinite ? RejectCause::infinite : RejectCause::saturated;
}

constexpr std::uint64_t kFreePairs = 1U << 20;  // that any film may have
constexpr std::uint64_t kPairBytes = 16;

Result<void> validate_domain(const AccumulatorSpec& spec) {
  using Domain = AccumulatorSpec::Domain;
  const bool table = spec.domain == Domain::table, keys = spec.domain == Domain::keys;
  if (table != (spec.entries > 0) || spec.entries > kMaxTableEntries)
    return spec_error(spec, std::to_string(spec.entries) + " entries, a table has 1 to " +
                                std::to_string(kMaxTableEntries) + ", and nothing else has any");
  if (!keys && !spec.key_names.empty()) return spec_error(spec, "it has names of keys, and no keys");
  if (keys && (spec.channels != 1 || spec.per != AccumulatorSpec::Per::job))
    return spec_error(spec, "sums by keys have one channel, and are of the whole job");
  std::uint64_t bytes = 0;
  for (const std::string& name : spec.key_names) bytes += name.size() + 1;
  if (bytes > kMaxKeyNameBytes)
    return spec_error(spec, std::to_string(spec.key_names.size()) + " names of keys have " +
                                std::to_string(bytes) + " bytes, at most " +
                                std::to_string(kMaxKeyNameBytes) + " are possible");
  return {};
}

}  // namespace

Layout grid_of(const AccumulatorSpec& spec, std::uint32_t width, std::uint32_t height) {
  if (spec.domain != AccumulatorSpec::Domain::table) return {width, height, 1};
  return {std::min(spec.entries, kTableRow), (spec.entries + kTableRow - 1) / kTableRow, 1};
}

std::uint64_t max_pairs(const AccumulatorSpec& spec, std::uint32_t width, std::uint32_t height) {
  const std::uint64_t pixels = std::uint64_t{width} * height;
  return std::min(pixels * spec.key_names.size(), std::max(pixels * kMaxPixelKeys, kFreePairs));
}

std::uint64_t sums_bytes(const AccumulatorSpec& spec, std::uint32_t width, std::uint32_t height) {
  if (spec.domain == AccumulatorSpec::Domain::keys) return max_pairs(spec, width, height) * kPairBytes;
  return grid_of(spec, width, height).pixel_count() * spec.channels * sizeof(std::int64_t);
}

Result<void> validate(std::span<const AccumulatorSpec> specs, std::uint32_t width, std::uint32_t height) {
  if (specs.size() > kMaxAccumulators)
    return input_error(std::to_string(specs.size()) + " accumulators, at most " +
                       std::to_string(kMaxAccumulators) + " are possible")
        .with_field("accumulators");
  std::vector<std::string> names;
  std::uint64_t channels = 0;
  for (const AccumulatorSpec& spec : specs) {
    names.push_back(spec.name);
    if (spec.channels == 0 || spec.channels > kMaxAccumulatorChannels)
      return spec_error(spec, std::to_string(spec.channels) + " channels, 1 to " +
                                  std::to_string(kMaxAccumulatorChannels) + " are possible");
    if (std::abs(spec.scale_log2) > kMaxScaleLog2)
      return spec_error(spec, "scale 2^" + std::to_string(spec.scale_log2) + " is out of bounds");
    CANDELA_TRY(validate_domain(spec));
    if (spec.domain == AccumulatorSpec::Domain::film) channels += spec.channels;
  }
  if (auto valid = validate_layer_names(names); !valid.ok())
    return input_error(valid.error().message).with_field("accumulators");
  if (std::uint64_t{width} * height > kMaxAccumulatorValues / std::max<std::uint64_t>(channels, 1))
    return input_error("a film of " + std::to_string(width) + " x " + std::to_string(height) +
                       " pixels is too large for accumulators of " + std::to_string(channels) +
                       " channels together")
        .with_field("accumulators");
  return {};
}

UnitAccumulator::UnitAccumulator(std::uint32_t width, std::uint32_t height, const AccumulatorSpec& spec)
    : spec_(spec),
      layout_(grid_of(spec, width, height)),
      units_per_value_(std::ldexp(1.0, spec.scale_log2)),
      limit_(kMaxContribution / units_per_value_) {
  if (spec.domain == AccumulatorSpec::Domain::keys) {
    max_pairs_ = max_pairs(spec, width, height);
    keys_ = UnitKeys(layout_);
    return;
  }
  sums_.resize(layout_.pixel_count() * spec.channels);
  touched_.resize(layout_.tile_count());
}

template <class ToSum>
bool UnitAccumulator::add_units(std::uint32_t x, std::uint32_t y, std::uint32_t first,
                                std::span<const double> values, std::uint64_t key,
                                SampleCounts& sample_counts, const ToSum& to_sum) {
  if (!holds(values)) [[unlikely]] {
    ++sample_counts.rejected[static_cast<std::size_t>(reject_cause(values))];
    return false;
  }
  touch(touched_[std::size_t{y / kTileSize} * layout_.tiles_x() + x / kTileSize]);
  std::int64_t* sums = sums_.data() + (std::size_t{y} * layout_.width + x) * spec_.channels + first;
  const std::uint64_t word = dither_word(key);
  bool wrapped = false;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double uniform = dither(word, static_cast<int>(first + i));
    wrapped |= to_sum(sums[i], quantise(values[i], units_per_value_, uniform));
  }
  if (wrapped) [[unlikely]]
    overflowed_.store(true, std::memory_order_relaxed);
  return true;
}

bool UnitAccumulator::add(std::uint32_t x, std::uint32_t y, std::uint32_t first,
                          std::span<const double> values, std::uint64_t key, SampleCounts& sample_counts) {
  Added added = Added::none;
  if (values.size() - 1 < kMaxChunk) [[likely]] {
    touch(touched_[std::size_t{y / kTileSize} * layout_.tiles_x() + x / kTileSize]);
    added = kAdders[values.size() - 1](
        sums_.data() + (std::size_t{y} * layout_.width + x) * spec_.channels + first, values.data(),
        limit_ * (kMaxFastUnits / kMaxContribution), units_per_value_,
        std::rotl(dither_word(key), static_cast<int>(first * kTurn % 64)));
  }
  if (added == Added::all) [[likely]]
    return true;
  if (added == Added::wrapped) {
    overflowed_.store(true, std::memory_order_relaxed);
    return true;
  }
  return add_units(x, y, first, values, key, sample_counts, [](std::int64_t& sum, std::int64_t units) {
    return __builtin_add_overflow(sum, units, &sum);
  });
}

bool UnitAccumulator::splat(std::uint32_t x, std::uint32_t y, std::uint32_t first,
                            std::span<const double> values, std::uint64_t key, SampleCounts& sample_counts) {
  return add_units(x, y, first, values, key, sample_counts, [](std::int64_t& sum, std::int64_t units) {
    if (units == 0) return false;  // most sectors of most paths: an atomic addition costs more than the test
    const std::int64_t before = __atomic_fetch_add(&sum, units, __ATOMIC_RELAXED);
    std::int64_t after = 0;
    return __builtin_add_overflow(before, units, &after);
  });
}

bool UnitAccumulator::add_key(std::uint32_t x, std::uint32_t y, std::uint32_t key, double value,
                              std::uint64_t sample_key, SampleCounts& sample_counts) {
  if (!holds({&value, 1})) [[unlikely]] {
    ++sample_counts.rejected[static_cast<std::size_t>(reject_cause({&value, 1}))];
    return false;
  }
  const double uniform = dither(dither_word(sample_key), 0);
  if (keys_.add(x, y, key, quantise(value, units_per_value_, uniform))) [[unlikely]]
    overflowed_.store(true, std::memory_order_relaxed);
  return true;
}

bool UnitAccumulator::overfull() const {
  return spec_.domain == AccumulatorSpec::Domain::keys && keys_.pairs() > max_pairs_;
}

void UnitAccumulator::clear() {
  keys_.clear();
  for (std::size_t tile = 0; tile < touched_.size(); ++tile) {
    if (touched_[tile] == 0) continue;
    const TileRect rect = tile_rect(layout_, tile);
    for (std::uint32_t y = rect.y; y < rect.y + rect.height; ++y)
      std::fill_n(sums_.data() + (std::size_t{y} * layout_.width + rect.x) * spec_.channels,
                  std::size_t{rect.width} * spec_.channels, 0);
    touched_[tile] = 0;
  }
  overflowed_.store(false, std::memory_order_relaxed);
}

void UnitAccumulator::put_sums(std::string& out) const {
  if (spec_.domain == AccumulatorSpec::Domain::keys)
    keys_.sums().put(out);
  else
    film::put_sums(out, layout_, spec_.channels, sums_, touched_);
}

MergedAccumulator::MergedAccumulator(std::uint32_t width, std::uint32_t height, const AccumulatorSpec& spec)
    : spec_(spec), layout_(grid_of(spec, width, height)) {
  if (keyed())
    keys_ = KeyedSums(layout_);
  else
    sums_ = TileSums(layout_, spec.channels);
}

Result<void> MergedAccumulator::merge(const MergedAccumulator& other) {
  if (other.layout_ != layout_ || other.spec_ != spec_)
    return refused_error("the accumulators differ in size or shape").with_field("accumulators");
  if (keyed())
    keys_.add(other.keys_);
  else
    sums_.add(other.sums_);
  return {};
}

std::string MergedAccumulator::serialise() const {
  std::string out;
  put_u32(out, layout_.width);
  put_u32(out, layout_.height);
  put_u32(out, spec_.channels);
  put_u32(out, static_cast<std::uint32_t>(spec_.scale_log2));
  if (keyed())
    keys_.put(out);
  else
    sums_.put(out);
  return out;
}

Result<MergedAccumulator> MergedAccumulator::parse(std::string_view bytes, std::uint32_t width,
                                                   std::uint32_t height, const AccumulatorSpec& spec) {
  Reader reader(bytes);
  MergedAccumulator out(width, height, spec);
  const Layout& grid = out.layout_;
  const bool same = reader.u32() == grid.width && reader.u32() == grid.height &&
                    reader.u32() == spec.channels &&
                    reader.u32() == static_cast<std::uint32_t>(spec.scale_log2);
  if (!same || !reader.ok()) return spec_error(spec, "the stored sums are of another shape");
  if (out.keyed()) {
    // Sums that were ahead of a prefix come to the others uncounted.
    CANDELA_ASSIGN(out.keys_,
                   KeyedSums::read(reader, grid, static_cast<std::uint32_t>(spec.key_names.size()),
                                   2 * max_pairs(spec, width, height), kMaxSum, "the accumulator"));
  } else {
    CANDELA_TRY(out.sums_.read(reader, kMaxSum, "the accumulator"));
  }
  if (!reader.rest().empty()) return spec_error(spec, "there are bytes too many");
  return out;
}

}  // namespace candela::film
