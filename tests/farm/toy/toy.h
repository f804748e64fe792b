// A toy of the adaptive kernels, for tests of epochs alone. Each pixel has a number, 2^level, that divides
// its samples. A sample's square is summed over each epoch. The rule carries the sum since a pixel's number
// was last doubled; if the mean is large enough, the next state doubles the number, and the sum begins anew.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/job/job.h"
#include "common/stages/decision.h"
#include "worker/integrators/unit_data.h"

namespace candela::toy {

inline constexpr const char* kName = "toy";
inline constexpr const char* kRule =
    "toy.doubling";  // and the name of the state: one byte, a level, per pixel
inline constexpr const char* kSquares = "toy.squares";
inline constexpr int kFilmScale = 20;

WorkPlan work_plan();

// All that a unit brings. Fails (input) unless `state` is one of this film.
Result<void> render(const Unit& unit, std::string_view state, std::uint32_t width, std::uint32_t height,
                    std::uint64_t seed, integrators::UnitOutput& output);
// Clear sums for a unit.
integrators::UnitOutput make_output(std::uint32_t width, std::uint32_t height, int film_scale_log2);

// The rule: integers in, integers out. The memo has a record for each pixel: how often the rule looked at the
// pixel (u32), and the iterations in the carried sum (u32).
Result<std::string> double_where_squares_say_so(const DecisionInput& input, Carry& carry);
// Figures: doublings, looks. Layer: level.
Result<StateReport> describe(const EpochPlan& plan, std::uint64_t epoch, std::uint32_t width,
                             std::uint32_t height, std::string_view state, const Carry& carry,
                             bool with_layers);

}  // namespace candela::toy
