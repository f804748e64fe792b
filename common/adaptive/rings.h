// Tests on rings whose sums are never zeroed, because a ring does not change when the radius does: the F test
// at every level, and the test of nested discs. Levels are steps of 2^(-1/2) of the radius: half of the area.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "common/adaptive/f_test.h"

namespace candela::adaptive {

// The two annuli of six sectors at a level: outside ring `level`, inside the sums of all deeper rings, which
// have the same area. Preconditions: kRingSectorChannels sums; 0 <= level < kRings - 1.
std::array<Int128, kSectorChannels> sectors_at(std::span<const Int128> rings, int level);

// The level that the F test leads to from `level`: while it rejects, and below `deepest`, one more. With
// `pairs` of antipodal sectors.
int ring_level(std::span<const Int128> rings, std::span<const Int128, kRings> squares, int square_shift,
               std::uint64_t critical, bool pairs, int level, int deepest);

// The sums of one pixel in units of phi, and the number of iterations in which the radius reached each ring.
struct DiscSums {
  std::array<double, kRings> sums{}, squares{}, passes{};
};

// The smallest level whose disc's mean agrees with those of the six next smaller discs within `kappa`
// standard errors of the difference, by the pooled second moment of the larger disc. Discs of fewer than 8
// effective photons do not object. A ring that no iteration reached makes no disc. At most kRings - 2.
int nested_level(const DiscSums& disc, double kappa);

}  // namespace candela::adaptive
