// Weights of the best technique as a development (common/mis/best.h): the film is the image of the balance
// heuristic, and accumulators hold what each technique alone would bring. The technique of a pixel is chosen
// for each half by the sums of the other.
#pragma once

#include <array>
#include <string_view>
#include <vector>

#include "common/mis/best.h"
#include "common/stages/development.h"

namespace candela::best_technique {

inline constexpr std::string_view kName = "best_technique";
inline constexpr std::array<std::string_view, 2> kEstimators = {"best", "balance"};

inline constexpr std::string_view kSingles = "mis.singles";  // [technique, then balance][color]
inline constexpr std::string_view kSquares = "mis.squares";  // [technique]
inline constexpr std::string_view kBatches = "mis.batches";  // their number

constexpr std::size_t singles_channels(std::size_t techniques) {
  return mis::kColors * (techniques + 1);
}

// Accumulators of the plan of work, in the order above.
std::vector<film::AccumulatorSpec> accumulators(std::size_t techniques, int film_scale_log2);
// Larger squares count as this one: they say no more than that the technique is bad there, and sums of many
// stay within 64 bits.
double max_square(const film::AccumulatorSpec& squares);

DevelopmentPlan plan(std::size_t techniques, mis::Eligible eligible);

Result<void> validate_plan(const WorkPlan& plan);
Corrections correct(const DevelopmentInput& input);

}  // namespace candela::best_technique
