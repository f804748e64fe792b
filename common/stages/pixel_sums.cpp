#include "common/stages/pixel_sums.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

namespace candela::pixel_sums {
namespace {

using film::AccumulatorSpec;

constexpr const char* kCounts = "counts";  // of samples in a batch, by technique: "1,1,2"
constexpr int kMaxCount = 1 << 16;

double unit_value(const film::MergedAccumulator& sums) {
  return std::ldexp(1.0, -sums.spec().scale_log2);
}

// Most sums fit into 64 bits, which are converted in one instruction.
double to_double(film::Int128 units) {
  const auto narrow = static_cast<std::int64_t>(units);
  return units == narrow ? static_cast<double>(narrow) : static_cast<double>(units);
}

}  // namespace

std::string name_of(std::string_view accumulator, std::size_t group) {
  return group == 0 ? std::string(accumulator) : fmt::format("{}.{}", accumulator, group);
}

std::vector<AccumulatorSpec> specs(std::size_t techniques, int film_scale_log2, std::size_t groups) {
  std::vector<AccumulatorSpec> out;
  for (std::size_t g = 0; g < groups; ++g) {
    out.push_back({name_of(kMatrix, g), matrix_channels(techniques), kMatrixScale});
    out.push_back({name_of(kVector, g), vector_channels(techniques),
                   std::min(film_scale_log2 + kVectorBits, film::kMaxScaleLog2)});
  }
  return out;
}

bool has_specs(const std::vector<AccumulatorSpec>& accumulators, std::size_t techniques, std::size_t groups) {
  const auto has = [&](const std::string& name, std::uint32_t channels) {
    return std::any_of(accumulators.begin(), accumulators.end(), [&](const AccumulatorSpec& spec) {
      return spec.name == name && spec.channels == channels && spec.per == AccumulatorSpec::Per::job &&
             spec.domain == AccumulatorSpec::Domain::film;
    });
  };
  for (std::size_t g = 0; g < groups; ++g)
    if (!has(name_of(kMatrix, g), matrix_channels(techniques)) ||
        !has(name_of(kVector, g), vector_channels(techniques)))
      return false;
  return true;
}

std::string counts_text(const mis::Allocation& allocation) {
  std::string counts;
  for (std::size_t i = 0; i < allocation.techniques; ++i)
    counts += fmt::format("{}{}", i == 0 ? "" : ",", static_cast<int>(allocation.counts[i]));
  return counts;
}

Result<mis::Allocation> parse_counts(const SettingsMap& constants) {
  const auto found = constants.find(kCounts);
  if (found == constants.end()) return input_error("it has no counts");
  mis::Allocation out;
  std::string_view text = found->second;
  while (!text.empty() && out.techniques < mis::kMaxTechniques) {
    const std::string_view word = text.substr(0, text.find(','));
    int count = 0;
    const auto [end, code] = std::from_chars(word.data(), word.data() + word.size(), count);
    if (code != std::errc() || end != word.data() + word.size() || count < 1 || count > kMaxCount)
      return input_error(fmt::format("'{}' is no number of samples", word));
    out.counts[out.techniques++] = count;
    text.remove_prefix(std::min(text.size(), word.size() + 1));
  }
  if (out.techniques == 0 || !text.empty())
    return input_error(fmt::format("'{}' are not 1 to {} counts", found->second, mis::kMaxTechniques));
  return out;
}

mis::Sums read(const film::MergedAccumulator* matrix, const film::MergedAccumulator* vector, std::uint32_t x,
               std::uint32_t y, std::size_t techniques) {
  mis::Sums sums;
  if (matrix == nullptr || vector == nullptr) return sums;
  const std::uint32_t entries = matrix_channels(techniques), light = vector_channels(techniques);
  const double per_matrix = unit_value(*matrix), per_vector = unit_value(*vector);
  std::array<film::Int128, film::kMaxAccumulatorChannels> units;  // those asked for are set
  matrix->get_pixel(x, y, std::span(units).first(entries));
  for (std::uint32_t i = 0; i < entries; ++i) sums.a[i] = to_double(units[i]) * per_matrix;
  vector->get_pixel(x, y, std::span(units).first(light));
  for (std::uint32_t k = 0; k < mis::kColors; ++k)
    for (std::uint32_t i = 0; i < techniques; ++i)
      sums.b[k][i] = to_double(units[k * techniques + i]) * per_vector;
  return sums;
}

}  // namespace candela::pixel_sums
