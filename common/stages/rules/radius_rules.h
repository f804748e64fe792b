// Decision rules of the integrators whose radius is a level per pixel: a state has one byte a pixel, the
// level (common/adaptive/levels.h).
#pragma once

#include "common/stages/decision.h"

namespace candela::rules {

// FPPM and VCM+: the F test on weighted sums in sectors [Lin et al. 2023], of luminance or of three colors:
// any that rejects shrinks. Constants: factor, max_level, floors, `critical` (times 2^32). Accumulators:
// fppm.sectors, fppm.squares.
Result<std::string> decide_fppm(const DecisionInput& input, Carry& carry);
Result<StateReport> describe_fppm(const EpochPlan& plan, std::uint64_t epoch, std::uint32_t width,
                                  std::uint32_t height, std::string_view state, const Carry& carry,
                                  bool with_layers);

std::uint64_t fppm_memo_bytes(const EpochPlan& plan);

// CPPM: the chi-squared test on counts. Constants: factor = 2^(-1/6), so that three levels are half of the
// area; max_level, floors, `critical_outer` and `critical_inner` (times 2^32), `first_batch`, `batch_growth`
// (times 2^16). Accumulator: cppm.counts.
Result<std::string> decide_cppm(const DecisionInput& input, Carry& carry);
Result<StateReport> describe_cppm(const EpochPlan& plan, std::uint64_t epoch, std::uint32_t width,
                                  std::uint32_t height, std::string_view state, const Carry& carry,
                                  bool with_layers);
std::uint64_t cppm_memo_bytes(const EpochPlan& plan);

// APPM: the plug-in bandwidth. Constants: factor, max_level, `c6`, `r_min`, `r_max`. Accumulators:
// appm.moments, appm.laplacian.
Result<std::string> decide_appm(const DecisionInput& input, Carry& carry);
Result<StateReport> describe_appm(const EpochPlan& plan, std::uint64_t epoch, std::uint32_t width,
                                  std::uint32_t height, std::string_view state, const Carry& carry,
                                  bool with_layers);

}  // namespace candela::rules
