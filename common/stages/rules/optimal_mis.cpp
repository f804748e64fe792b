#include "common/stages/rules/optimal_mis.h"

#include <fmt/format.h>

#include <cstdint>

#include "common/stages/epoch_corrections.h"
#include "common/stages/pixel_sums.h"

namespace candela::rules {
namespace {

// Reads a pixel's sums of an epoch, or of the carry.
epoch_corrections::HalfSums read(const film::MergedAccumulator& matrix, const film::MergedAccumulator& vector,
                                 std::uint32_t x, std::uint32_t y, std::size_t techniques) {
  return {pixel_sums::read(&matrix, &vector, x, y, techniques, 0),
          pixel_sums::read(&matrix, &vector, x, y, techniques, 1)};
}

}  // namespace

std::uint64_t optimal_mis_memo_bytes(const EpochPlan& /*plan*/) {
  return epoch_corrections::kPixelBytes;
}

Result<std::string> decide_optimal_mis(const DecisionInput& input, Carry& carry) {
  const Result<mis::Allocation> allocation = pixel_sums::parse_counts(input.plan.constants);
  if (!allocation.ok()) return failed_error(allocation.error().message);
  const std::size_t n = allocation->techniques, pixels = std::size_t{input.width} * input.height;
  const std::string state(1, '\0');
  const auto fits = [&](const auto& sums, const auto& spec_of) {
    return sums.size() == 2 && spec_of(sums[0]).name == pixel_sums::kMatrix &&
           spec_of(sums[1]).name == pixel_sums::kVector &&
           pixel_sums::has_specs({spec_of(sums[0]), spec_of(sums[1])}, n, film::AccumulatorSpec::Per::epoch);
  };
  if (!fits(
          carry.sums, [](const auto& sums) -> const auto& { return sums.spec(); }))
    return failed_error(
        fmt::format("the rule '{}' needs accumulators that are not the job's", input.plan.rule));
  if (input.epoch == 0) carry.memo.assign(pixels * epoch_corrections::kPixelBytes, '\0');
  if (carry.memo.size() != pixels * epoch_corrections::kPixelBytes)
    return failed_error(fmt::format("the rule '{}' carries a memo of another film", input.plan.rule));
  if (!input.folded) return state;
  const auto& sums = input.folded->sums;
  if (!fits(
          sums, [](const auto* accumulator) -> const auto& { return accumulator->spec(); }))
    return failed_error("the epoch to fold is of another job");

  std::size_t pixel = 0;
  for (std::uint32_t y = 0; y < input.height; ++y)
    for (std::uint32_t x = 0; x < input.width; ++x, ++pixel) {
      epoch_corrections::HalfColors corrections = epoch_corrections::read(carry.memo, pixel);
      epoch_corrections::add(*allocation, read(carry.sums[0], carry.sums[1], x, y, n),
                             read(*sums[0], *sums[1], x, y, n), corrections);
      epoch_corrections::write(carry.memo, pixel, corrections);
    }
  for (std::size_t i = 0; i < carry.sums.size(); ++i) CANDELA_TRY(carry.sums[i].merge(*sums[i]));
  return state;
}

}  // namespace candela::rules
