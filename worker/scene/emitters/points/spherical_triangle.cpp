#include "worker/scene/emitters/points/spherical_triangle.h"

#include <algorithm>
#include <cmath>

#include "worker/core/math.h"

namespace candela::scene {
namespace {

// Into [0, 1]; a NaN becomes 0.
double share(double x) {
  return x >= 0 ? std::min(x, 1.0) : 0.0;
}

}  // namespace

double solid_angle_of_triangle(Vec3d a, Vec3d b, Vec3d c, double volume) {
  const double la = length(a), lb = length(b), lc = length(c);
  return 2 * math::atan2(volume, la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb);
}

SphericalTriangle::SphericalTriangle(Vec3d a, Vec3d b, Vec3d c, double volume)
    : a_(a), b_(b), c_(c), volume_(volume), solid_angle_(solid_angle_of_triangle(a, b, c, volume)) {}

TVec2<double> SphericalTriangle::sample(double u, double v) const {
  // With E = C - A, unit vectors a and b, T = tan(u S / 2), k = 1 + a.b, s = a + b and D = det(a, b, E):
  //   T = t D / (k |A + t E| + s.(A + t E)),   s.A = k |A|
  // which squared and divided by t is linear in t. T = sine / cosine is multiplied out.
  const double la = length(a_), lb = length(b_);
  const Vec3d a = a_ / la, b = b_ / lb, e = c_ - a_;
  double sine = 0, cosine = 0;
  math::sincos(u * solid_angle_ / 2, sine, cosine);
  const double k = 1 + dot(a, b), p = cosine * volume_ / (la * lb) - sine * dot(a + b, e), q = sine * k;
  const double t = share(2 * q * (q * dot(a_, e) + p * la) / (p * p - q * q * length_squared(e)));

  // The arc from B to C', in the plane that the two span: along b, and across.
  const Vec3d f = e * t + (a_ - b_);  // C' - B
  const double along = dot(f, b), across = length(cross(b, f));
  const double adjacent = lb + along, distance = std::sqrt(adjacent * adjacent + across * across);
  const double one_minus_cosine =
      adjacent > 0 ? across * across / (distance * (distance + adjacent)) : 1 - adjacent / distance;
  const double w = v * one_minus_cosine, sin_arc = std::sqrt(std::max(0.0, w * (2 - w)));
  const double toward = across * (1 - w) - along * sin_arc;
  const double tau = across > 0 ? share(lb * sin_arc / toward) : v;
  return {1 - tau, tau * t};
}

}  // namespace candela::scene
