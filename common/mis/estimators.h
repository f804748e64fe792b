// Estimators of optimal multiple importance sampling: what the image gains on the balance heuristic, made
// from merged sums when somebody reads it.
//
// For any slopes alpha,
//   T F = S_F + alpha . (W / M 1 - S_r)                              [Kondapaneni 2019, Eq. 16, with f = 0
//   kept]
// is unbiased if alpha does not depend on the same samples: the second term, the *correction*, has
// expectation zero. W / M is the number of batches that the sums hold. Batches of a pixel that drew no
// samples, since the eye path met nothing to light, are not among them, and their share of the image is in no
// control.
//
//   direct    alpha from the same sums; biased by O(1/T), consistent
//   crossfit  alpha of each half from the other half; unbiased
#pragma once

#include <array>

#include "common/mis/sums.h"

namespace candela::mis {

using Slopes = std::array<Vector, kColors>;  // alpha, by color

// Solves the centered system with a ridge that makes the slopes fall back to those of the balance heuristic,
// zero. No rank is decided with ridge > 0: dependent techniques get slopes that cancel. ridge = 0 leaves out
// directions whose pivot is below 1e-10 of the number of batches: for tests.
Slopes solve(const Allocation& allocation, const Sums& sums, double ridge);

// alpha . (W / M 1 - S_r).
Color correction(const Allocation& allocation, const Sums& sums, const Slopes& slopes);

// The ridge of a system whose sums hold W samples and whose S_A was rounded to multiples of 2^-scale_log2:
// max(factor / T, 8 N sqrt(T M) 2^-scale_log2), T = W / M.
double ridge(const Allocation& allocation, double samples, int scale_log2, double factor = 0.1);

// The slopes of sums that were rounded so, with that ridge; zero without samples.
Slopes ridge_slopes(const Allocation& allocation, const Sums& sums, int scale_log2);

// Corrections to the sum of the balance heuristic's estimates from each of two halves, which add up to the
// estimate from both; zero while there is no second batch. `scale_log2` is S_A's.
std::array<Color, 2> crossfit_halves(const Allocation& allocation, const Sums& half0, const Sums& half1,
                                     int scale_log2);
std::array<Color, 2> direct_halves(const Allocation& allocation, const Sums& half0, const Sums& half1,
                                   int scale_log2);

}  // namespace candela::mis
