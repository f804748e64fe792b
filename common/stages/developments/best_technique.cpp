#include "common/stages/developments/best_technique.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace candela::best_technique {
namespace {

using film::AccumulatorSpec;

constexpr const char* kEligible = "eligible";  // by technique: "0,1,1"

// The film's mean is about 2^20 of its units. Squares of it are then about 2^24 units, and squares of a
// thousand times as much are still below the largest.
constexpr int kSquareShift = 16;
constexpr int kMaxSquareUnits = 46;  // log2

struct Techniques {
  std::size_t count = 0;
  mis::Eligible eligible = 0;
};

Error bad(std::string message) {
  return input_error(std::move(message)).with_field("work.development");
}

Result<Techniques> techniques_of(const DevelopmentPlan& plan) {
  const auto found = plan.constants.find(kEligible);
  const std::string text = found == plan.constants.end() ? "" : found->second;
  Techniques out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool digit = i % 2 == 0;
    const bool expected = digit ? text[i] == '0' || text[i] == '1' : text[i] == ',';
    if (!expected || (!digit && i + 1 == text.size()) || out.count == mis::kMaxTechniques)
      return bad(
          fmt::format("'{}' is no list of 0 and 1 for at most {} techniques", text, mis::kMaxTechniques));
    if (digit && text[i] == '1') out.eligible |= 1U << out.count;
    if (digit) ++out.count;
  }
  if (out.eligible == 0) return bad("no technique is eligible");
  return out;
}

// The accumulators of a half; null: nothing is merged.
struct Half {
  const film::MergedAccumulator* singles;
  const film::MergedAccumulator* squares;
  const film::MergedAccumulator* batches;

  Half(const DevelopmentInput& input, std::uint32_t half)
      : singles(input.sums(kSingles, half)),
        squares(input.sums(kSquares, half)),
        batches(input.sums(kBatches, half)) {}
  mis::Singles at(std::uint32_t x, std::uint32_t y, std::size_t techniques) const {
    mis::Singles out;
    if (singles == nullptr || squares == nullptr || batches == nullptr) return out;
    const auto n = static_cast<std::uint32_t>(techniques);
    const double per_single = std::ldexp(1.0, -singles->spec().scale_log2);
    const double per_square = std::ldexp(1.0, -squares->spec().scale_log2);
    for (std::uint32_t i = 0; i <= n; ++i)
      for (std::uint32_t k = 0; k < mis::kColors; ++k)
        (i < n ? out.single[i] : out.balance)[k] =
            static_cast<double>(singles->sum(x, y, i * mis::kColors + k)) * per_single;
    for (std::uint32_t i = 0; i < n; ++i)
      out.squares[i] = static_cast<double>(squares->sum(x, y, i)) * per_square;
    out.batches = static_cast<double>(batches->sum(x, y, 0));
    return out;
  }
};

}  // namespace

std::vector<AccumulatorSpec> accumulators(std::size_t techniques, int film_scale_log2) {
  constexpr int kMax = film::kMaxScaleLog2;
  return {
      {std::string(kSingles), static_cast<std::uint32_t>(singles_channels(techniques)), film_scale_log2,
       AccumulatorSpec::Per::job},
      {std::string(kSquares), static_cast<std::uint32_t>(techniques),
       std::clamp(2 * film_scale_log2 - kSquareShift, -kMax, kMax), AccumulatorSpec::Per::job},
      {std::string(kBatches), 1, 0, AccumulatorSpec::Per::job},
  };
}

double max_square(const AccumulatorSpec& squares) {
  return std::ldexp(1.0, kMaxSquareUnits - squares.scale_log2);
}

DevelopmentPlan plan(std::size_t techniques, mis::Eligible eligible) {
  std::string text;
  for (std::size_t i = 0; i < techniques; ++i)
    text += fmt::format("{}{}", i == 0 ? "" : ",", eligible >> i & 1);
  return {std::string(kName), {{kEligible, text}, {"estimator", "best"}}};
}

Result<void> validate_plan(const WorkPlan& plan) {
  CANDELA_ASSIGN(const Techniques techniques, techniques_of(*plan.development));
  const auto has = [&](std::string_view name, std::size_t channels) {
    return std::any_of(plan.accumulators.begin(), plan.accumulators.end(), [&](const AccumulatorSpec& spec) {
      return spec.name == name && spec.channels == channels && spec.per == AccumulatorSpec::Per::job &&
             spec.domain == AccumulatorSpec::Domain::film;
    });
  };
  if (has(kSingles, singles_channels(techniques.count)) && has(kSquares, techniques.count) &&
      has(kBatches, 1))
    return {};
  return bad(fmt::format("{} techniques need accumulators that the plan has not", techniques.count));
}

Corrections correct(const DevelopmentInput& input) {
  if (input.estimator == "balance") return {};
  const Result<Techniques> techniques = techniques_of(input.plan);
  if (!techniques.ok()) return {};
  const std::array<Half, 2> halves = {Half(input, 0), Half(input, 1)};
  Corrections out;
  for (auto& half : out) half.resize(std::size_t{input.width} * input.height * mis::kColors);
  for (std::uint32_t y = 0; y < input.height; ++y)
    for (std::uint32_t x = 0; x < input.width; ++x) {
      const std::array<mis::Singles, 2> sums = {halves[0].at(x, y, techniques->count),
                                                halves[1].at(x, y, techniques->count)};
      const std::size_t at = (std::size_t{y} * input.width + x) * mis::kColors;
      for (std::size_t half = 0; half < 2; ++half) {
        const auto best = mis::best_technique(techniques->count, techniques->eligible, sums[1 - half]);
        const mis::Color color = mis::single_correction(sums[half], best);
        for (std::size_t k = 0; k < mis::kColors; ++k) out[half][at + k] = static_cast<float>(color[k]);
      }
    }
  return out;
}

}  // namespace candela::best_technique
