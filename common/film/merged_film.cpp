// The job's film: exact merging, the checkpoint form, and the image.
//
// Checkpoint bytes: "CANFILM3"; width, height, layers, scale_log2 (u32 each); for each half the number of
// ranges (u64) and the ranges (u64 begin, end), sample counts (11 u64), runs of tiles that are not all zero,
// and for each group of 32 tiles and each channel its byte planes; XXH64 of all before (u64). Integers are
// little-endian. Sums are coded as 128-bit zigzag integers, so the bytes do not tell how wide a tile is in
// memory: equal content gives equal bytes. "CANFILM1" and "CANFILM2", with sample counts of 7 and 10 u64, are
// read too.
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

constexpr std::string_view kMagic = "CANFILM3";
constexpr std::string_view kFirstMagic = "CANFILM1", kSecondMagic = "CANFILM2";

bool add_checked(std::uint64_t& sum, std::uint64_t value) {
  return !__builtin_add_overflow(sum, value, &sum);
}

// The sum of two sample counts, or nothing if a count would wrap around.
std::optional<SampleCounts> sum_of(const SampleCounts& a, const SampleCounts& b) {
  SampleCounts sum = a;
  bool fits = add_checked(sum.eye_samples, b.eye_samples);
  fits &= add_checked(sum.light_paths, b.light_paths);
  fits &= add_checked(sum.rays, b.rays);
  for (std::size_t i = 0; i < sum.rejected.size(); ++i) fits &= add_checked(sum.rejected[i], b.rejected[i]);
  fits &= add_checked(sum.sampled_merges, b.sampled_merges);
  fits &= add_checked(sum.repeated_merges, b.repeated_merges);
  fits &= add_checked(sum.bounded_walks, b.bounded_walks);
  if (!fits) return std::nullopt;
  return sum;
}

Error overlap_error(std::uint32_t half, std::uint64_t begin, std::uint64_t end) {
  return refused_error("iterations [" + std::to_string(begin) + ", " + std::to_string(end) + ") of half " +
                       std::to_string(half) + " are merged already, at least in part")
      .with_field("unit");
}

}  // namespace

MergedFilm::MergedFilm(Layout layout, int scale_log2) : layout_(layout), scale_log2_(scale_log2) {
  for (Half& half : halves_) half.sums = TileSums(layout, kChannels);
}

Result<void> MergedFilm::merge(const Delta& delta) {
  const DeltaInfo& info = delta.info();
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
  const auto sample_counts = sum_of(half.sample_counts, delta.sample_counts());
  if (!sample_counts) return refused_error("the delta's counts are impossibly large").with_field("counts");

  IndexSet merged = half.merged;  // all that can run out of memory comes before the first change
  merged.insert(unit.begin, unit.end);
  half.sums.add(delta.film());
  half.sample_counts = *sample_counts;
  half.merged = std::move(merged);
  return {};
}

Result<void> MergedFilm::merge(const MergedFilm& other) {
  if (other.layout_ != layout_ || other.scale_log2_ != scale_log2_) {
    return refused_error("the films differ in layout or scale").with_field("layout");
  }
  std::array<SampleCounts, 2> sample_counts;
  for (std::uint32_t h = 0; h < 2; ++h) {
    for (const auto& [begin, end] : other.halves_[h].merged.ranges()) {
      if (halves_[h].merged.intersects(begin, end)) return overlap_error(h, begin, end);
    }
    const auto sum = sum_of(halves_[h].sample_counts, other.halves_[h].sample_counts);
    if (!sum) return refused_error("the films' counts are impossibly large").with_field("counts");
    sample_counts[h] = *sum;
  }
  if (&other == this) return {};  // only reached if it is empty
  // All that can run out of memory comes before the first change.
  std::array<IndexSet, 2> merged;
  for (std::uint32_t h = 0; h < 2; ++h) {
    merged[h] = halves_[h].merged;
    for (const auto& [begin, end] : other.halves_[h].merged.ranges()) merged[h].insert(begin, end);
  }
  TileSums first = halves_[0].sums;
  first.add(other.halves_[0].sums);
  halves_[1].sums.add(other.halves_[1].sums);
  halves_[0].sums = std::move(first);
  for (std::uint32_t h = 0; h < 2; ++h) {
    halves_[h].sample_counts = sample_counts[h];
    halves_[h].merged = std::move(merged[h]);
  }
  return {};
}

MergedFilm MergedFilm::first_layers(std::uint32_t count) const {
  MergedFilm image({layout_.width, layout_.height, std::min(count, layout_.layers)}, scale_log2_);
  for (std::size_t h = 0; h < 2; ++h) {
    Half& to = image.halves_[h];
    const Half& from = halves_[h];
    to.sums = from.sums.first_layers(image.layout_);
    to.merged = from.merged;
    to.sample_counts = from.sample_counts;
  }
  return image;
}

bool MergedFilm::black(std::uint32_t layers) const {
  const Layout first{layout_.width, layout_.height, std::min(layers, layout_.layers)};
  return std::all_of(halves_.begin(), halves_.end(),
                     [&](const Half& half) { return half.sums.zero(first.tile_count()); });
}

Int128 MergedFilm::sum(std::uint32_t half, std::uint32_t layer, std::uint32_t x, std::uint32_t y,
                       int channel) const {
  return halves_[half].sums.sum(layer, x, y, static_cast<std::uint32_t>(channel));
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
  const TileSums::Tile none;
  const double divisor = static_cast<double>(count);
  const double value_per_unit = std::ldexp(1.0, -scale_log2_);
  // Integer to double rounds to nearest whether it comes from 64 or from 128 bits.
  const auto mean = [&](double sum) { return sum / divisor * value_per_unit; };
  for (std::uint32_t x = 0; x < layout_.width; x += kTileSize) {
    const TilePlace at = tile_place(layout_, layer, x, y);
    const std::uint32_t width = std::min<std::uint32_t>(kTileSize, layout_.width - x);
    const TileSums::Tile& a = first ? halves_[0].sums.tile(at.tile) : none;
    const TileSums::Tile& b = second ? halves_[1].sums.tile(at.tile) : none;
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
        const auto get = [&](const TileSums::Tile& tile, std::size_t i) -> Int128 {
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

void MergedFilm::serialise_half(std::string& out, const Half& half) {
  put_u64(out, half.merged.ranges().size());
  for (const auto& [begin, end] : half.merged.ranges()) {
    put_u64(out, begin);
    put_u64(out, end);
  }
  put_sample_counts(out, half.sample_counts);
  half.sums.put(out);
}

std::string MergedFilm::serialise() const {
  std::string out;
  serialise(out);
  return out;
}

void MergedFilm::serialise(std::string& out) const {
  // Reserves an upper bound: a growing string of a hundred megabytes is copied again and again. Reserved
  // pages that nobody writes to take no memory.
  constexpr std::size_t kHeaders = 1 << 16;
  out.clear();
  out.reserve(kHeaders + halves_[0].sums.memory_bytes() + halves_[1].sums.memory_bytes());
  out += kMagic;
  put_layout(out, layout_, scale_log2_);
  for (const Half& half : halves_) serialise_half(out, half);
  seal(out);
}

Result<void> MergedFilm::parse_half(Reader& reader, SampleCountsForm form, Half& half) {
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
  half.sample_counts = read_sample_counts(reader, form);
  return half.sums.read(reader, static_cast<Uint128>(half.merged.count()) << 63, "the film");
}

Result<MergedFilm> MergedFilm::parse(std::string_view bytes) {
  const bool first = bytes.starts_with(kFirstMagic), second = bytes.starts_with(kSecondMagic);
  const SampleCountsForm form = first    ? SampleCountsForm::first
                                : second ? SampleCountsForm::second
                                         : SampleCountsForm::present;
  CANDELA_ASSIGN(const std::string_view content, unseal(bytes,
                                                        first    ? kFirstMagic
                                                        : second ? kSecondMagic
                                                                 : kMagic,
                                                        "the film"));
  Reader reader(content);
  Layout layout;
  layout.width = reader.u32();
  layout.height = reader.u32();
  layout.layers = reader.u32();
  const int scale_log2 = static_cast<std::int32_t>(reader.u32());
  if (!reader.ok()) return input_error("the film ends in its header").with_field("length");
  CANDELA_TRY(validate(layout, scale_log2));
  MergedFilm film(layout, scale_log2);
  for (Half& half : film.halves_) CANDELA_TRY(parse_half(reader, form, half));
  if (!reader.rest().empty()) {
    return input_error("the film has " + std::to_string(reader.rest().size()) + " bytes too many")
        .with_field("length");
  }
  return film;
}

}  // namespace candela::film
