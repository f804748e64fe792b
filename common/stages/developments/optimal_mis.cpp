#include "common/stages/developments/optimal_mis.h"

#include <fmt/format.h>

#include "common/base/rows.h"
#include "common/stages/epoch_corrections.h"

namespace candela::optimal_mis {
namespace {

using mis::Allocation;
using Per = film::AccumulatorSpec::Per;
using epoch_corrections::HalfColors;
using Halves = epoch_corrections::HalfSums;

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

Result<void> validate_sums(const WorkPlan& plan, Per per) {
  const Result<Allocation> allocation = pixel_sums::parse_counts(plan.development->constants);
  if (!allocation.ok()) return bad(allocation.error().message);
  CANDELA_ASSIGN(const std::size_t groups, parse_groups(plan.development->constants));
  if (per == Per::epoch && groups != 1) return bad("sums of epochs are of one group of lights");
  if (pixel_sums::has_specs(plan.accumulators, allocation->techniques, per, groups)) return {};
  return bad(fmt::format("{} techniques and groups of lights: {} need accumulators that the plan has not",
                         allocation->techniques, groups));
}

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

// By an estimator that looks at the sums of the whole job.
HalfColors from_all(std::string_view estimator, const Allocation& allocation, const Halves& sums) {
  const auto f = estimator == "crossfit" ? &mis::crossfit_halves : &mis::direct_halves;
  return f(allocation, sums[0], sums[1], pixel_sums::kMatrixScale);
}

// The sums of an epoch, or of the epochs that are folded. Null: zeros.
struct EpochSums {
  const film::MergedAccumulator* matrix = nullptr;
  const film::MergedAccumulator* vector = nullptr;

  Halves at(std::uint32_t x, std::uint32_t y, std::size_t techniques) const {
    return {pixel_sums::read(matrix, vector, x, y, techniques, 0),
            pixel_sums::read(matrix, vector, x, y, techniques, 1)};
  }
};

}  // namespace

DevelopmentPlan plan(std::string_view name, const Allocation& allocation, std::string_view estimator,
                     std::size_t groups) {
  DevelopmentPlan out{
      std::string(name),
      {{"counts", pixel_sums::counts_text(allocation)}, {"estimator", std::string(estimator)}}};
  if (groups != 1) out.constants[kGroups] = std::to_string(groups);
  return out;
}

Result<void> validate_plan(const WorkPlan& plan) {
  return validate_sums(plan, Per::job);
}

Corrections correct(const DevelopmentInput& input) {
  if (input.estimator == "balance") return {};
  const Result<Allocation> allocation = pixel_sums::parse_counts(input.plan.constants);
  const Result<std::size_t> count = parse_groups(input.plan.constants);
  if (!allocation.ok() || !count.ok()) return {};
  std::vector<std::array<EpochSums, 2>> groups(*count);
  for (std::size_t g = 0; g < groups.size(); ++g)
    for (std::uint32_t half = 0; half < 2; ++half)
      groups[g][half] = {input.sums(pixel_sums::name_of(pixel_sums::kMatrix, g), half),
                         input.sums(pixel_sums::name_of(pixel_sums::kVector, g), half)};
  return for_pixels(input, [&](std::uint32_t x, std::uint32_t y) {
    HalfColors out{};
    for (const std::array<EpochSums, 2>& group : groups) {
      Halves sums;
      for (std::size_t half = 0; half < 2; ++half)
        sums[half] =
            pixel_sums::read(group[half].matrix, group[half].vector, x, y, allocation->techniques, 0);
      const HalfColors corrections = from_all(input.estimator, *allocation, sums);
      for (std::size_t half = 0; half < 2; ++half)
        for (std::size_t k = 0; k < mis::kColors; ++k) out[half][k] += corrections[half][k];
    }
    return out;
  });
}

Result<void> validate_epoch_plan(const WorkPlan& plan) {
  CANDELA_TRY(validate_sums(plan, Per::epoch));
  if (!plan.epochs || plan.epochs->rule != epoch_corrections::kRule)
    return bad(fmt::format("it needs epochs of the rule '{}'", epoch_corrections::kRule));
  const auto counts = [](const SettingsMap& constants) {
    const auto found = constants.find("counts");
    return found == constants.end() ? std::string() : found->second;
  };
  if (counts(plan.epochs->constants) != counts(plan.development->constants))
    return bad("the rule of its epochs has other counts");
  return {};
}

Corrections correct_epochs(const DevelopmentInput& input) {
  if (input.estimator == "balance") return {};
  const Result<Allocation> allocation = pixel_sums::parse_counts(input.plan.constants);
  if (!allocation.ok()) return {};
  const std::size_t n = allocation->techniques;
  // The order of the plan's accumulators is that of pixel_sums::specs().
  EpochSums folded;
  if (input.carry != nullptr) folded = {&input.carry->sums[0], &input.carry->sums[1]};
  std::vector<EpochSums> open;
  for (const auto& epoch : input.open) open.push_back({epoch[0], epoch[1]});
  const bool progressive = input.estimator == "progressive";
  return for_pixels(input, [&](std::uint32_t x, std::uint32_t y) {
    Halves all = folded.at(x, y, n);
    HalfColors out{};
    if (progressive && input.carry != nullptr)
      out = epoch_corrections::read(input.carry->memo, std::size_t{y} * input.width + x);
    for (const EpochSums& sums : open) {
      const Halves epoch = sums.at(x, y, n);
      if (progressive) epoch_corrections::add(*allocation, all, epoch, out);
      for (std::size_t half = 0; half < 2; ++half) all[half].add(epoch[half]);
    }
    return progressive ? out : from_all(input.estimator, *allocation, all);
  });
}

}  // namespace candela::optimal_mis
