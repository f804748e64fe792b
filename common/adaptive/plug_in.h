// The plug-in bandwidth of APPM: the radius that minimizes the asymptotic mean squared error, from sums over
// all photons so far, and the bandwidth of the pilot that estimates the Laplacian. + - * / and sqrt alone.
//
//   r_N^6 = 2 k3 m2 / (k2^2 L^2 N)
//
// [Kaplanyan 2017, Eq. 5.15, with the second moment m2 and k3 in place of a variance over pi]. The sums are
// A2 = sum phi^2 k_r(y) pi r_1^2 and D1 = sum phi D_h(y) pi r_1^4, with phi in units of film values; N drops
// out: (r / r_1)^6 = c6 A2 / D1^2, c6 = 2 pi k3 / k2^2, for the constant kernel 32.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "common/adaptive/levels.h"
#include "common/base/result.h"

namespace candela::adaptive {

// c6 of a kernel on the unit disc with k2 = integral of y_u^2 k and k3 = integral of k^2. `recursive`: for
// the mean over all radii so far, whose optimum is smaller (a third inside the root).
double plug_in_constant(double k2, double k3, bool recursive);

// D_h(y) pi h^4 of the five-point stencil of constant kernels for y = (u, v): the number of the four shifted
// discs that y is in, minus 4 if it is in the middle one. 0 for |y| > 2 h.
int laplacian_stencil(double u, double v, double h);

// h / r_1 in an epoch that begins at iteration `begin`: (1/2) N^(-1/10) or N^(-1/8), N = max(1, begin).
enum class Pilot { tenth, eighth };
double pilot_bandwidth(Pilot pilot, std::uint64_t begin);
// (x > 0) x^(1/5), by Newton's method.
double fifth_root(double x);

class PlugIn {
 public:
  // r_min, r_max: bounds of r N^(1/6) / r_1, r_min <= r_max.
  PlugIn(const Levels& levels, double c6, double r_min, double r_max);

  // The level whose radius is nearest to r_N in the logarithm, from real sums of `iterations` iterations.
  // `present` if there were no photons (a2 <= 0) or no iterations. Without curvature (d1 = 0) the radius is
  // the largest that is allowed.
  int level(double a2, double d1, std::uint64_t iterations, int present) const;

 private:
  std::vector<double> thresholds_;  // [g]: (r / r_1)^6 halfway between levels g and g + 1; decreasing
  double c6_, min6_, max6_;
  int max_level_;
};

}  // namespace candela::adaptive
