// Radiance of a clear sky: the model of Hosek and Wilkie [2012] with coefficients of our own fit to radiances
// of Mitsuba 0.6 (tests/bench/fit_sky.py, docs/lab/sky.md).
#pragma once

#include <array>
#include <vector>

#include "worker/core/vec.h"

namespace candela::scene {

// By turbidity - 1, albedo of the ground, channel, parameter (the nine of the formula, then the mean
// radiance) and control point of a Bezier curve in the cube root of the sun's elevation over 90 degrees.
extern const float kSkyCoefficients[10][2][3][10][6];

class SkyModel {
 public:
  // turbidity in [1, 10]; albedo of the ground in [0, 1] by channel; elevation of the sun in radians, in
  // [0, pi / 2]. Radiance is linear in turbidity between whole numbers, in albedo, and in the elevation below
  // one degree.
  SkyModel(double turbidity, const Vec3d& albedo, double elevation);

  // Linear Rec.709 in W / (m^2 sr nm). cos_theta: of the angle to the zenith, not negative. gamma: the angle
  // to the sun, in radians.
  Vec3d radiance(double cos_theta, double gamma) const;

 private:
  // One parameter set; `scale` is the mean radiance times the weight of the set.
  struct Perez {
    double a, b, c, d, e, f, g, h, i, scale;
  };
  void add(double turbidity, const Vec3d& albedo, double elevation, double share);

  std::array<std::vector<Perez>, 3> sets_;  // by channel
};

}  // namespace candela::scene
