#include "common/stages/developments/optimal_mis.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

namespace candela::optimal_mis {
namespace {

constexpr std::string_view kCounts = "counts";  // of samples in a batch, by technique: "1,1,2"
constexpr double kMaxCount = 1 << 16;

Error bad(std::string message) {
  return input_error(std::move(message)).with_field("work.development");
}

Result<mis::Allocation> allocation_of(const DevelopmentPlan& plan) {
  const auto found = plan.constants.find(std::string(kCounts));
  if (found == plan.constants.end()) return bad("it has no counts");
  mis::Allocation out;
  std::string_view text = found->second;
  while (!text.empty() && out.techniques < mis::kMaxTechniques) {
    const std::string_view word = text.substr(0, text.find(','));
    int count = 0;
    const auto [end, code] = std::from_chars(word.data(), word.data() + word.size(), count);
    if (code != std::errc() || end != word.data() + word.size() || count < 1 || count > kMaxCount)
      return bad(fmt::format("'{}' is no number of samples", word));
    out.counts[out.techniques++] = count;
    text.remove_prefix(std::min(text.size(), word.size() + 1));
  }
  if (out.techniques == 0 || !text.empty())
    return bad(fmt::format("'{}' are not 1 to {} counts", found->second, mis::kMaxTechniques));
  return out;
}

// The accumulators of a half, and the values of their units.
struct Half {
  const film::MergedAccumulator* matrix;
  const film::MergedAccumulator* vector;
  double per_matrix = 0, per_vector = 0;  // value of one unit

  Half(const DevelopmentInput& input, std::uint32_t half)
      : matrix(input.sums(kMatrix, half)), vector(input.sums(kVector, half)) {
    if (matrix != nullptr) per_matrix = std::ldexp(1.0, -matrix->spec().scale_log2);
    if (vector != nullptr) per_vector = std::ldexp(1.0, -vector->spec().scale_log2);
  }
  mis::Sums at(std::uint32_t x, std::uint32_t y, std::size_t techniques) const {
    mis::Sums sums;
    if (matrix == nullptr || vector == nullptr) return sums;
    for (std::uint32_t i = 0; i < mis::packed_size(techniques); ++i)
      sums.a[i] = static_cast<double>(matrix->sum(x, y, i)) * per_matrix;
    for (std::uint32_t k = 0; k < mis::kColors; ++k)
      for (std::uint32_t i = 0; i < techniques; ++i)
        sums.b[k][i] =
            static_cast<double>(vector->sum(x, y, k * static_cast<std::uint32_t>(techniques) + i)) *
            per_vector;
    return sums;
  }
};

}  // namespace

std::vector<film::AccumulatorSpec> accumulators(std::size_t techniques, int film_scale_log2) {
  using film::AccumulatorSpec;
  return {{std::string(kMatrix), static_cast<std::uint32_t>(mis::packed_size(techniques)), kMatrixScale,
           AccumulatorSpec::Per::job},
          {std::string(kVector), static_cast<std::uint32_t>(mis::kColors * techniques),
           std::min(film_scale_log2 + kVectorBits, film::kMaxScaleLog2), AccumulatorSpec::Per::job}};
}

DevelopmentPlan plan(const mis::Allocation& allocation, std::string_view estimator) {
  std::string counts;
  for (std::size_t i = 0; i < allocation.techniques; ++i)
    counts += fmt::format("{}{}", i == 0 ? "" : ",", static_cast<int>(allocation.counts[i]));
  return {std::string(kName), {{std::string(kCounts), counts}, {"estimator", std::string(estimator)}}};
}

Result<void> validate_plan(const WorkPlan& plan) {
  CANDELA_ASSIGN(const mis::Allocation allocation, allocation_of(*plan.development));
  const auto has = [&](std::string_view name, std::size_t channels) {
    for (const film::AccumulatorSpec& spec : plan.accumulators)
      if (spec.name == name) return spec.channels == channels && spec.per == film::AccumulatorSpec::Per::job;
    return false;
  };
  if (!has(kMatrix, mis::packed_size(allocation.techniques)) ||
      !has(kVector, mis::kColors * allocation.techniques))
    return bad(fmt::format("{} techniques need accumulators that the plan has not", allocation.techniques));
  return {};
}

Corrections correct(const DevelopmentInput& input) {
  if (input.estimator == "balance") return {};
  const Result<mis::Allocation> parsed = allocation_of(input.plan);
  if (!parsed.ok()) return {};
  const mis::Allocation& allocation = *parsed;
  const std::array<Half, 2> halves = {Half(input, 0), Half(input, 1)};
  const bool crossfit = input.estimator == "crossfit";
  Corrections out;
  const std::size_t values = std::size_t{input.width} * input.height * mis::kColors;
  for (auto& half : out) half.resize(values);
  for (std::uint32_t y = 0; y < input.height; ++y) {
    for (std::uint32_t x = 0; x < input.width; ++x) {
      const std::array<mis::Sums, 2> sums = {halves[0].at(x, y, allocation.techniques),
                                             halves[1].at(x, y, allocation.techniques)};
      const std::array<mis::Color, 2> corrections =
          crossfit ? mis::crossfit_halves(allocation, sums[0], sums[1], kMatrixScale)
                   : mis::direct_halves(allocation, sums[0], sums[1], kMatrixScale);
      const std::size_t at = (std::size_t{y} * input.width + x) * mis::kColors;
      for (std::size_t half = 0; half < 2; ++half)
        for (std::size_t k = 0; k < mis::kColors; ++k)
          out[half][at + k] = static_cast<float>(corrections[half][k]);
    }
  }
  return out;
}

}  // namespace candela::optimal_mis
