// Optimal multiple importance sampling as a development: the film is the image of the balance heuristic, and
// two accumulators hold S_A and S_b of common/mis/sums.h, a pair for each half of the job and each group of
// lights (constant `groups`; 1 without it). Groups have slopes of their own, and the image the sum of
// corrections.
#pragma once

#include <array>
#include <string_view>

#include "common/mis/estimators.h"
#include "common/stages/development.h"
#include "common/stages/pixel_sums.h"

namespace candela::optimal_mis {

inline constexpr std::string_view kName = "optimal_mis";
inline constexpr std::array<std::string_view, 3> kEstimators = {"crossfit", "direct", "balance"};

// Precondition: counts are integers. `groups` of lights: 1 to pixel_sums::kMaxGroups.
DevelopmentPlan plan(const mis::Allocation& allocation, std::string_view estimator, std::size_t groups = 1);

Result<void> validate_plan(const WorkPlan& plan);
Corrections correct(const DevelopmentInput& input);

}  // namespace candela::optimal_mis
