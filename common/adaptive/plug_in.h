// The plug-in bandwidth of APPM: the radius that minimizes the asymptotic mean squared error, from sums over
// all photons so far, and the bandwidth of the pilot that estimates the Laplacian. + - * / and sqrt alone.
//
//   r_N^6 = 2 k3 m2 / (k2^2 L^2 N)
//
// [Kaplanyan 2017, Eq. 5.15, with the second moment m2 and k3 in place of a variance over pi]. The sums are
// A2 = sum phi^2 k_r(y) pi r_1^2 and D1 = sum phi D_h(y) pi r_1^4, with phi in units of film values; N drops
// out: (r / r_1)^6 = c6 A2 / D1^2, c6 = 2 pi k3 / k2^2, for the constant kernel 32.
//
// In media merging has three dimensions: the variance goes as r^-3, and r_N^7 = 3 k3 m2 / (k2^2 L^2 N) with
// the ball's k2 and k3. A pixel that merges on surfaces and in media has one radius, and the sum of both
// variances and of both biases: with x = r / r_1
//   A x^-2 + M x^-3 + (1/4) B^2 x^4 is least at   x^6 (D1 + q D1')^2 = c6 A2 + c7 A2' / x,
// A2', D1': the sums of media, with 4/3 pi r_1^3 in place of pi r_1^2; q: the ball's k2 over the disc's;
// c7 = 4 pi k3' / k2^2. The right side falls with x, the left one grows: there is one solution.
#pragma once

#include <cstdint>
#include <vector>

#include "common/adaptive/levels.h"

namespace candela::adaptive {

// c6 of a kernel on the unit disc with k2 = integral of y_u^2 k and k3 = integral of k^2.
double plug_in_constant(double k2, double k3);

// The plug-in radius of merges in media, from k2 of the disc and k2, k3 of the ball.
struct PlugInMedia {
  double c7 = 0, k2_ratio = 0;
};
PlugInMedia plug_in_media(double disc_k2, double ball_k2, double ball_k3);

// h / r_1 in an epoch that begins at iteration `begin`: (1/2) N^(-1/10), N = max(1, begin).
double pilot_bandwidth(std::uint64_t begin);
// (x > 0) x^(1/5), by Newton's method.
double fifth_root(double x);

// The pilot of a pixel by a normal reference: for I exp(-|y|^2 / 2 s^2), of which s^2 = 2 I / |L|, the mean
// squared error of the Laplacian is least at
//   h^10 = c_L^10 s^10 m2 / (N s^2 I^2),   c_L^10 = 3 C / (2 (1/2 + 4 k2)^2),
// C: the energy of the stencil. With the sum A1 = sum phi k_r(y) pi r_1^2 beside those above, N drops out:
//   (h / r_1)^10 = pi c_L^10 z^4 A2 / A1^2,   z = min(2 A1 / |D1|, 4).
// h is one of kPilotLevels levels, 2^(-1/16) apart, from 1/2 down to 1/50 of r_1.
inline constexpr int kPilotLevels = 75;
double reference_constant(double k2, double energy);  // pi c_L^10
double pilot_of_level(int level);                     // h / r_1
class ReferencePilot {
 public:
  explicit ReferencePilot(double c10);
  // `present` without light.
  int level(double a1, double a2, double d1, int present) const;

 private:
  double c10_;
  std::vector<double> thresholds_;  // [g]: (h / r_1)^10 halfway between levels g and g + 1; decreasing
};

class PlugIn {
 public:
  // r_min, r_max: bounds of r N^(1/6) / r_1, of r N^(1/7) / r_1 in pixels without surfaces; r_min <= r_max.
  PlugIn(const Levels& levels, double c6, double r_min, double r_max, const PlugInMedia& media = {});

  // The level whose radius is nearest to r_N in the logarithm, from real sums of `iterations` iterations.
  // `present` if there were no photons (a2 <= 0) or no iterations. Without curvature (d1 = 0) the radius is
  // the largest that is allowed.
  int level(double a2, double d1, std::uint64_t iterations, int present) const;
  // The same with sums of media beside.
  int level(double a2, double d1, double medium_a2, double medium_d1, std::uint64_t iterations,
            int present) const;

 private:
  std::vector<double> borders_;     // [g]: r / r_1 halfway between levels g and g + 1; decreasing
  std::vector<double> thresholds_;  // their sixth powers
  double c6_, r_min_, r_max_, min6_, max6_;
  PlugInMedia media_;
  int max_level_;
};

}  // namespace candela::adaptive
