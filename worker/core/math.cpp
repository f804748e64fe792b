// The double functions and the rarer float ones of math.h.
#include "worker/core/math.h"

namespace candela::math {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
// log 2 in two parts; the first has its low 21 bits zero, so that k times it is exact for every exponent k.
constexpr double kLn2High = 6.93147180369123816490e-01;
constexpr double kLn2Low = 1.90821492927058770002e-10;

// A number as an unevaluated sum, high being its rounding to double.
struct Pair {
  double high, low;
};
Pair two_sum(double a, double b) {
  const double sum = a + b;
  const double bb = sum - a;
  return {sum, (a - (sum - bb)) + (b - bb)};
}

// exp(high + low), low small against 1.
double exp_pair(double high, double low) {
  if (high != high) return high;
  if (high > 709.79) return kInfinity;
  if (high < -745.2) return 0;
  const double n = std::nearbyint(high * std::numbers::log2e);
  const double r = ((high - n * kLn2High) - n * kLn2Low) + low;
  // Taylor to r^13: the first term left out is below 5e-18 on |r| <= ln 2 / 2.
  const double p = detail::polynomial(
      r, {1.0 / 2, 1.0 / 6, 1.0 / 24, 1.0 / 120, 1.0 / 720, 1.0 / 5040, 1.0 / 40320, 1.0 / 362880,
          1.0 / 3628800, 1.0 / 39916800, 1.0 / 479001600, 1.0 / 6227020800.0});
  const double value = 1 + (r + r * r * p);
  // Two factors: 2^n alone may leave the range of normal numbers where the result does not.
  const auto k = static_cast<std::int64_t>(n);
  return value * detail::pow2(k / 2) * detail::pow2(k - k / 2);
}

// log x for finite positive x, to about 1e-18 relative: k log 2 + 2 atanh(s), s = f / (2 + f) carried in two
// parts.
Pair log_pair(double x) {
  std::int64_t subnormal = 0;
  if (x < 0x1p-1022) {
    x *= 0x1p54;
    subnormal = 54;
  }
  std::int64_t k = 0;
  const double f = detail::split_exponent(x, k) - 1;  // exact
  k -= subnormal;
  const Pair g = two_sum(2.0, f);
  const double s = f / g.high;
  const double s_low = (std::fma(-s, g.high, f) - s * g.low) / g.high;
  const double z = s * s;
  // 2 atanh(s) = 2 s + s z (2/3 + 2/5 z + ...): the first term left out is below 1e-18 of the sum.
  const double series = detail::polynomial(
      z, {2.0 / 3, 2.0 / 5, 2.0 / 7, 2.0 / 9, 2.0 / 11, 2.0 / 13, 2.0 / 15, 2.0 / 17, 2.0 / 19, 2.0 / 21});
  const double tail = 2 * s_low + s * z * series;
  const Pair m = two_sum(2 * s, tail);
  const double kd = static_cast<double>(k);
  const Pair head = two_sum(kd * kLn2High, m.high);
  return two_sum(head.high, head.low + (m.low + kd * kLn2Low));
}

}  // namespace

double exp(double x) {
  return exp_pair(x, 0);
}

double log(double x) {
  if (!(x > 0)) return x == 0 ? -kInfinity : kNaN;
  if (x == kInfinity) return x;
  return log_pair(x).high;
}

double pow(double x, double y) {
  if (y == 0 || x == 1) return 1;
  if (x != x || y != y || x < 0) return kNaN;
  if (x == 0) return y > 0 ? 0 : kInfinity;
  if (x == kInfinity) return y > 0 ? kInfinity : 0;
  if (std::abs(y) == kInfinity) return (x > 1) == (y > 0) ? kInfinity : 0;
  const Pair l = log_pair(x);
  const double product = y * l.high;
  if (!(std::abs(product) < 1e4)) return product > 0 ? kInfinity : 0;
  return exp_pair(product, std::fma(y, l.high, -product) + y * l.low);
}

double srgb_to_linear(double v) {
  return v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
}

double atan2(double y, double x) {
  const double ay = std::abs(y), ax = std::abs(x);
  if (ax != ax || ay != ay) return x + y;
  const bool steep = ay > ax;
  const double low = steep ? ax : ay, high = steep ? ay : ax;
  // The quotient and, beyond tan(pi/8), (t - 1) / (t + 1) without a quotient before it.
  double offset = 0, t = 0;
  if (high > 0) {
    if (low > 0.41421356237309503 * high) {
      offset = std::numbers::pi / 4;
      t = low == high ? 0.0 : (low - high) / (low + high);
    } else {
      t = low / high;
    }
  }
  // Interpolated at Chebyshev nodes in t^2 on [0, tan^2(pi/8)], relative error 4e-18.
  double angle = offset + t * detail::polynomial(
                                  t * t, {1.0, -0.3333333333333312, 0.19999999999940893, -0.14285714279250245,
                                          0.11111110744919658, -0.09090896809064027, 0.07692045330902225,
                                          -0.06662951813629191, 0.05846878297330872, -0.05035102456601552,
                                          0.03796525745386593, -0.017805397205419446});
  if (steep) angle = std::numbers::pi / 2 - angle;
  if (std::signbit(x)) angle = std::numbers::pi - angle;
  return std::copysign(angle, y);
}

void sincos(double x, double& sine, double& cosine) {
  std::uint64_t quadrant = 0;
  const double r = detail::reduce_quadrant(x, quadrant), z = r * r;
  // Taylor; the first terms left out are below 1e-18 on |r| <= pi/4.
  const double s =
      r + r * z *
              detail::polynomial(z, {-1.0 / 6, 1.0 / 120, -1.0 / 5040, 1.0 / 362880, -1.0 / 39916800,
                                     1.0 / 6227020800.0, -1.0 / 1307674368000.0, 1.0 / 355687428096000.0});
  const double c =
      1 + z * detail::polynomial(z, {-1.0 / 2, 1.0 / 24, -1.0 / 720, 1.0 / 40320, -1.0 / 3628800,
                                     1.0 / 479001600, -1.0 / 87178291200.0, 1.0 / 20922789888000.0});
  const double a = (quadrant & 1) != 0 ? c : s, b = (quadrant & 1) != 0 ? s : c;
  sine = (quadrant & 2) != 0 ? -a : a;
  cosine = ((quadrant + 1) & 2) != 0 ? -b : b;
}

}  // namespace candela::math
