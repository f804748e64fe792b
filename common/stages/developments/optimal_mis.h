// Optimal multiple importance sampling as developments: the film is the image of the balance heuristic, and
// two accumulators hold S_A and S_b of common/mis/sums.h.
//
//   optimal_mis         a pair for each half of the job and each group of lights (constant `groups`; 1
//                       without it). Groups have slopes of their own, and the image the sum of corrections
//   optimal_mis_epochs  a pair for each epoch. The rule of the same name (rules/optimal_mis.h) folds whole
//                       epochs into its carry; the epochs that it has not folded are read beside it
#pragma once

#include <array>
#include <string_view>
#include <vector>

#include "common/mis/estimators.h"
#include "common/stages/development.h"
#include "common/stages/pixel_sums.h"

namespace candela::optimal_mis {

inline constexpr std::string_view kName = "optimal_mis";
inline constexpr std::array<std::string_view, 3> kEstimators = {"crossfit", "direct", "balance"};
inline constexpr std::string_view kEpochName = "optimal_mis_epochs";
inline constexpr std::array<std::string_view, 4> kEpochEstimators = {"progressive", "crossfit", "direct",
                                                                     "balance"};

// Precondition: counts are integers. `name`: kName or kEpochName.
// `groups` of lights: 1 to pixel_sums::kMaxGroups, 1 for kEpochName.
DevelopmentPlan plan(std::string_view name, const mis::Allocation& allocation, std::string_view estimator,
                     std::size_t groups = 1);

Result<void> validate_plan(const WorkPlan& plan);
Corrections correct(const DevelopmentInput& input);

Result<void> validate_epoch_plan(const WorkPlan& plan);
Corrections correct_epochs(const DevelopmentInput& input);

}  // namespace candela::optimal_mis
