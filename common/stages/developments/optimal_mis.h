// Optimal multiple importance sampling as a development: the film is the image of the balance heuristic, and
// two accumulators for each half hold S_A and S_b of common/mis/sums.h.
#pragma once

#include <array>
#include <string_view>
#include <vector>

#include "common/mis/estimators.h"
#include "common/stages/development.h"

namespace candela::optimal_mis {

inline constexpr std::string_view kName = "optimal_mis";
inline constexpr std::string_view kMatrix = "mis.matrix";  // S_A, packed
inline constexpr std::string_view kVector = "mis.vector";  // S_b, [color][technique]
inline constexpr std::array<std::string_view, 3> kEstimators = {"crossfit", "direct", "balance"};

// Bits below one of S_A's integers. Rounding changes an image by 1e-11 of itself.
inline constexpr int kMatrixScale = 32;
// S_b has as many bits more than the film: it is what slopes are from, not the image.
inline constexpr int kVectorBits = 4;

// Accumulators of the plan of work, matrix and vector in this order.
std::vector<film::AccumulatorSpec> accumulators(std::size_t techniques, int film_scale_log2);
// Precondition: counts are integers.
DevelopmentPlan plan(const mis::Allocation& allocation, std::string_view estimator);

Result<void> validate_plan(const WorkPlan& plan);
Corrections correct(const DevelopmentInput& input);

}  // namespace candela::optimal_mis
