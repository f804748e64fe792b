// Points of a triangle uniform in the solid angle that it fills, by the two steps of [Arvo 1995]: a part ABC'
// of the spherical triangle that has the share u of its area, C' on the edge AC; then a point on the arc from
// B to C', uniform in the cosine of the angle from B.
//
// Arvo finds C' from the angles of the spherical triangle, which cancel for small ones. Here C' = A + t (C -
// A) on the flat triangle: tan(area / 2) of ABC' as [Oosterom 1983, Eq. 8] has it is the square root of a
// quadratic of t over a linear one, whose equation has the root 0 and the one in closed form below. Nothing
// in it cancels for small triangles.
#pragma once

#include "worker/core/vec.h"

namespace candela::scene {

class SphericalTriangle {
 public:
  // Corners as seen from the reference. volume > 0: their triple product without its sign, which callers know
  // without cancellation: twice the triangle's area times the distance of its plane.
  SphericalTriangle(Vec3d a, Vec3d b, Vec3d c, double volume);
  double solid_angle() const { return solid_angle_; }
  // Barycentric coordinates of B and C. u, v in [0, 1].
  TVec2<double> sample(double u, double v) const;

 private:
  Vec3d a_, b_, c_;
  double volume_, solid_angle_;
};

// The solid angle of a triangle; its corners are seen along a, b, c. [Oosterom 1983, Eq. 8]
double solid_angle_of_triangle(Vec3d a, Vec3d b, Vec3d c, double volume);

}  // namespace candela::scene
