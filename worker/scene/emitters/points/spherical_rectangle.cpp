#include "worker/scene/emitters/points/spherical_rectangle.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "worker/core/math.h"

namespace candela::scene {
namespace {

double arc_cosine(double x) {
  return math::atan2(std::sqrt(std::max(0.0, (1 - x) * (1 + x))), x);
}

// Into [low, high]; a NaN becomes low.
double clamped(double x, double low, double high) {
  return x >= low ? std::min(x, high) : low;
}

}  // namespace

double solid_angle_of_rectangle(double x0, double x1, double y0, double y1, double z) {
  const Vec3d corners[] = {{x0, y0, z}, {x1, y0, z}, {x0, y1, z}, {x1, y1, z}};
  double r[4];
  for (int i = 0; i < 4; ++i) r[i] = length(corners[i]);
  // tan(omega / 2) = volume / d for each triangle of the diagonal 00-11 [Oosterom 1983, Eq. 8].
  const double volume = z * (x1 - x0) * (y1 - y0);
  const double diagonal = dot(corners[0], corners[3]);
  const auto denominator = [&](int i) {
    return r[0] * r[i] * r[3] + dot(corners[0], corners[i]) * r[3] + dot(corners[i], corners[3]) * r[0] +
           diagonal * r[i];
  };
  // The two half angles are the arguments of complex numbers, their sum, below pi, that of the product.
  const double a = denominator(1), b = denominator(2);
  return 2 * math::atan2(volume * (a + b), a * b - volume * volume);
}

SphericalRectangle::SphericalRectangle(double x0, double x1, double y0, double y1, double z)
    : x0_(x0), x1_(x1), y0_(y0), y1_(y1), z_(z), solid_angle_(solid_angle_of_rectangle(x0, x1, y0, y1, z)) {}

TVec2<double> SphericalRectangle::sample(double u, double v) const {
  // The closed form. [Urena 2013, Sec. 4]
  const double zz = z_ * z_;
  const double a0 = -x0_ / std::sqrt(x0_ * x0_ + zz);
  const double b0 = -y0_ / std::sqrt(y0_ * y0_ + zz), b1 = y1_ / std::sqrt(y1_ * y1_ + zz);
  const double part = u * solid_angle_;
  const double phi = part + 2 * std::numbers::pi - arc_cosine(-a0 * b0) - arc_cosine(-a0 * b1);
  double sine = 0, cosine = 0;
  math::sincos(phi, sine, cosine);
  const double t = (b0 * cosine - b1) / sine;
  const double a = std::copysign(1 / std::sqrt(t * t + b0 * b0), t);
  double x = clamped(a * z_ / std::sqrt(std::max(0.0, (1 - a) * (1 + a))), x0_, x1_);
  // One Newton step on the solid angle of [x0, x].
  const double dx = x * x + zz;
  const double derivative =
      z_ * (y1_ / std::sqrt(dx + y1_ * y1_) - y0_ / std::sqrt(dx + y0_ * y0_)) / dx;  // per x
  const double excess = solid_angle_of_rectangle(x0_, x, y0_, y1_, z_) - part;
  if (derivative > 0) x = clamped(x - excess / derivative, x0_, x1_);

  // k = sine of the elevation over the line at x, uniform. Its range is taken without cancellation where both
  // ends lie on one side.
  const double d2 = x * x + zz;
  const double r0 = std::sqrt(d2 + y0_ * y0_), r1 = std::sqrt(d2 + y1_ * y1_);
  const double k0 = y0_ / r0;
  const double range =
      y0_ * y1_ > 0 ? d2 * (y1_ - y0_) * (y0_ + y1_) / (r0 * r1 * (y1_ * r0 + y0_ * r1)) : y1_ / r1 - k0;
  const double step = v * range, k = k0 + step;
  const double cos_squared = (1 - k) * (1 + k);
  if (!(cos_squared > 0)) return {x, k > 0 ? y1_ : y0_};
  const double s = std::sqrt(cos_squared), s0 = std::sqrt(d2) / r0;
  const double y = k * k0 > 0 ? y0_ + std::sqrt(d2) * step * (k + k0) / (s * s0 * (k * s0 + k0 * s))
                              : k * std::sqrt(d2) / s;
  return {x, clamped(y, y0_, y1_)};
}

}  // namespace candela::scene
