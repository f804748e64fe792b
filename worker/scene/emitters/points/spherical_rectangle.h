// Points of a rectangle uniform in the solid angle that it fills [Urena 2013], in its own axes: the reference
// is the origin, the rectangle is [x0, x1] x [y0, y1] at the distance z > 0 along its normal.
//
// The solid angle is the sum of two triangles' [Oosterom 1983], whose triple products are exactly z times the
// area: unlike the sum of the corners' angles it does not cancel for small or distant rectangles. One Newton
// step with it mends the closed form of the warp.
#pragma once

#include "worker/core/vec.h"

namespace candela::scene {

class SphericalRectangle {
 public:
  // Precondition: x0 < x1, y0 < y1, z > 0.
  SphericalRectangle(double x0, double x1, double y0, double y1, double z);
  double solid_angle() const { return solid_angle_; }
  // (x, y) of the point. u and v in [0, 1]: the shares of the solid angle on the side of x0, and of the strip
  // dx at x on the side of y0.
  TVec2<double> sample(double u, double v) const;

 private:
  double x0_, x1_, y0_, y1_, z_, solid_angle_;
};

// Solid angle of [x0, x1] x [y0, y1] at z > 0. Zero if x0 = x1 or y0 = y1.
double solid_angle_of_rectangle(double x0, double x1, double y0, double y1, double z);

}  // namespace candela::scene
