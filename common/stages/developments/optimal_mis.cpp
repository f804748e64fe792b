#include "common/stages/developments/optimal_mis.h"

#include <fmt/format.h>

#include "common/base/rows.h"

namespace candela::optimal_mis {
namespace {

using mis::Allocation;
using HalfColors = std::array<mis::Color, 2>;
using Halves = std::array<mis::Sums, 2>;

Error bad(std::string message) {
  return input_error(std::move(message)).with_field("work.development");
}

constexpr const char* kGroups = "groups";  // of lights: "2"; left out: 1

Result<std::size_t> parse_groups(const SettingsMap& constants) {
  const auto found = constants.find(kGroups);
  if (found == constants.end()) return std::size_t{1};
  const std::string& text = found->second;
  if (text.size() == 1 && text[0] >= '1' && text[0] <= static_cast<char>('0' + pixel_sums::kMaxGroups))
    return static_cast<std::size_t>(text[0] - '0');
  return bad(fmt::format("'{}' is no number of groups from 1 to {}", text, pixel_sums::kMaxGroups));
}
static_assert(pixel_sums::kMaxGroups < 10);

// Corrections of all pixels: of_pixel(x, y) has those of its halves.
template <class OfPixel>
Corrections for_pixels(const DevelopmentInput& input, const OfPixel& of_pixel) {
  Corrections out;
  for (auto& half : out) half.resize(std::size_t{input.width} * input.height * mis::kColors);
  for_each_row(input.height, [&](std::uint32_t y) {
    for (std::uint32_t x = 0; x < input.width; ++x) {
      const HalfColors corrections = of_pixel(x, y);
      const std::size_t at = (std::size_t{y} * input.width + x) * mis::kColors;
      for (std::size_t half = 0; half < 2; ++half)
        for (std::size_t k = 0; k < mis::kColors; ++k)
          out[half][at + k] = static_cast<float>(corrections[half][k]);
    }
  });
  return out;
}

// Null: zeros.
struct GroupSums {
  const film::MergedAccumulator* matrix = nullptr;
  const film::MergedAccumulator* vector = nullptr;
};

}  // namespace

DevelopmentPlan plan(const Allocation& allocation, std::string_view estimator, std::size_t groups) {
  DevelopmentPlan out{
      std::string(kName),
      {{"counts", pixel_sums::counts_text(allocation)}, {"estimator", std::string(estimator)}}};
  if (groups != 1) out.constants[kGroups] = std::to_string(groups);
  return out;
}

Result<void> validate_plan(const WorkPlan& plan) {
  const Result<Allocation> allocation = pixel_sums::parse_counts(plan.development->constants);
  if (!allocation.ok()) return bad(allocation.error().message);
  CANDELA_ASSIGN(const std::size_t groups, parse_groups(plan.development->constants));
  if (pixel_sums::has_specs(plan.accumulators, allocation->techniques, groups)) return {};
  return bad(fmt::format("{} techniques and groups of lights: {} need accumulators that the plan has not",
                         allocation->techniques, groups));
}

Corrections correct(const DevelopmentInput& input) {
  if (input.estimator == "balance") return {};
  const Result<Allocation> allocation = pixel_sums::parse_counts(input.plan.constants);
  const Result<std::size_t> count = parse_groups(input.plan.constants);
  if (!allocation.ok() || !count.ok()) return {};
  const auto estimate = input.estimator == "crossfit" ? &mis::crossfit_halves : &mis::direct_halves;
  std::vector<std::array<GroupSums, 2>> groups(*count);
  for (std::size_t g = 0; g < groups.size(); ++g)
    for (std::uint32_t half = 0; half < 2; ++half)
      groups[g][half] = {input.sums(pixel_sums::name_of(pixel_sums::kMatrix, g), half),
                         input.sums(pixel_sums::name_of(pixel_sums::kVector, g), half)};
  return for_pixels(input, [&](std::uint32_t x, std::uint32_t y) {
    HalfColors out{};
    for (const std::array<GroupSums, 2>& group : groups) {
      Halves sums;
      for (std::size_t half = 0; half < 2; ++half)
        sums[half] = pixel_sums::read(group[half].matrix, group[half].vector, x, y, allocation->techniques);
      const HalfColors corrections = estimate(*allocation, sums[0], sums[1], pixel_sums::kMatrixScale);
      for (std::size_t half = 0; half < 2; ++half)
        for (std::size_t k = 0; k < mis::kColors; ++k) out[half][k] += corrections[half][k];
    }
    return out;
  });
}

}  // namespace candela::optimal_mis
