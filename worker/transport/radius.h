// Radii of progressive kernel estimation as functions of the iteration alone [Knaus 2011], so that any worker
// can do any iteration. The variance of one iteration may grow by (k + 1) / (k + alpha) each time, hence what
// a merge covers (area pi r^2, volume 4/3 pi r^3) shrinks by the inverse:
//
//   shrinkage_i = prod_{k = 1}^{i} (k + alpha) / (k + 1),      i = 0, 1, 2 ... (0: the first iteration, 1)
//   surfaces: r_i = r_0 sqrt(shrinkage_i),      media: r_i = r_0 cbrt(shrinkage_i)
//
// The variance of the mean of n iterations falls as n^-alpha, its bias as n^(alpha - 1) (surfaces).
#pragma once

#include <cstdint>

namespace candela::transport {

// prod_{k=1}^{iteration} (k + alpha) / (k + 1) for 0 < alpha <= 1: 1 in the first iteration (number 0),
// always 1 if alpha is. Relative error below 1e-12 up to iteration 2^40; the same bits on every machine.
double shrinkage(std::uint64_t iteration, double alpha);

// The radius of an iteration: of discs on surfaces, and of balls in media.
double disc_radius(double first_radius, std::uint64_t iteration, double alpha);
double ball_radius(double first_radius, std::uint64_t iteration, double alpha);

// The radius of a merge that blurs over a line, a disc or a ball (dimension 1, 2, 3): the power law whose
// variance and squared bias fall alike, first_radius (iteration + 1)^(-1 / (4 + dimension)).
double blur_radius(double first_radius, std::uint64_t iteration, int dimension);

}  // namespace candela::transport
