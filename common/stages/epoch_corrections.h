// Corrections of the progressive estimator, epoch by epoch: slopes of an epoch are from the sums of all
// epochs before it. The rule `optimal_mis` adds those of whole epochs up in its memo, [pixel][half][color] as
// doubles, and the development adds those of the epochs that are not folded.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <string_view>

#include "common/mis/estimators.h"

namespace candela::epoch_corrections {

inline constexpr std::string_view kRule = "optimal_mis";

using HalfSums = std::array<mis::Sums, 2>;
using HalfColors = std::array<mis::Color, 2>;
inline constexpr std::size_t kPixelBytes = sizeof(HalfColors);

// Adds an epoch's corrections, with slopes from `before`, the sums of all epochs before it.
void add(const mis::Allocation& allocation, const HalfSums& before, const HalfSums& epoch,
         HalfColors& corrections);

// Precondition: the memo is that of a film with this pixel.
HalfColors read(std::string_view memo, std::size_t pixel);
void write(std::string& memo, std::size_t pixel, const HalfColors& corrections);

}  // namespace candela::epoch_corrections
