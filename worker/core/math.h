// Elementary functions whose bits do not depend on the machine. glibc picks its sinf, expf, powf ... by CPU
// at run time (with or without FMA), so two machines of one farm could differ in a last bit; these are
// polynomials in plain IEEE double arithmetic, rounded to float where the name ends in f. Errors are stated
// in units of the last place of a float. sqrt, floor, copysign and fma are IEEE-exact and come from <cmath>.
//
// NaN in gives NaN out everywhere.
#pragma once

#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>

namespace candela::math {

inline constexpr float kPi = std::numbers::pi_v<float>;
inline constexpr float kInvPi = std::numbers::inv_pi_v<float>;

float sinf(float x);  // |x| up to 1e5 radians: <= 1 ulp; beyond, accuracy falls but stays in [-1, 1]
float cosf(float x);
void sincosf(float x, float& sine, float& cosine);
float tanf(float x);
float asinf(float x);  // argument clamped to [-1, 1]
float acosf(float x);
float atanf(float x);
float atan2f(float y, float x);  // atan2(+-0, x) as IEEE 754 recommends
float expf(float x);
float logf(float x);             // x > 0; -inf at 0, NaN below
float powf(float x, float y);    // x >= 0, NaN below
double exp(double x);            // <= 2 ulp of double
double log(double x);            // <= 2 ulp of double
double pow(double x, double y);  // x >= 0; relative error <= 1e-13 for results in range
float erff(float x);
float erfinvf(float x);  // +-inf at +-1, NaN beyond
double erfcx(double x);  // exp(x^2) erfc(x) for x >= 0; relative error <= 1e-11 up to 11

namespace detail {

// Estrin's scheme: c[0] + c[1] x + ... in about log2(N) dependent steps. N is small and known: it unrolls.
template <std::size_t N>
inline double polynomial(double x, const double (&c)[N]) {
  double a[N];
  for (std::size_t i = 0; i < N; ++i) a[i] = c[i];
  double power = x;
  for (std::size_t n = N; n > 1; n = (n + 1) / 2) {
    for (std::size_t i = 0; i < n / 2; ++i) a[i] = a[2 * i] + a[2 * i + 1] * power;
    if (n % 2 == 1) a[n / 2] = a[n - 1];
    power *= power;
  }
  return a[0];
}

inline double pow2(std::int64_t n) {  // -1022 <= n <= 1023
  return std::bit_cast<double>(static_cast<std::uint64_t>(n + 1023) << 52);
}

// x = n pi/2 + r, |r| <= pi/4. The first part of pi/2 has 33 bits, so n times it is exact for |n| < 2^20.
inline double reduce_quadrant(double x, std::uint64_t& quadrant) {
  constexpr double kPiHalfHigh = 1.57079632673412561417e+00;
  constexpr double kPiHalfLow = 6.07710050650619224932e-11;
  const double n = std::nearbyint(x * (2 * std::numbers::inv_pi));
  double r = (x - n * kPiHalfHigh) - n * kPiHalfLow;
  if (std::abs(x) > 1e9) {  // far beyond the stated range: keep the result a sine
    quadrant = 0;
    r = std::abs(x) < std::numeric_limits<double>::infinity() ? (r < -0.785  ? -0.785
                                                                 : r > 0.785 ? 0.785
                                                                             : r)
                                                              : x - x;
    return r;
  }
  quadrant = static_cast<std::uint64_t>(static_cast<std::int64_t>(n));
  return r;
}

// Taylor; the first term left out is below 1e-11 on |r| <= pi/4.
inline double sin_kernel(double r) {
  const double z = r * r;
  return r + r * z * polynomial(z, {-1.0 / 6, 1.0 / 120, -1.0 / 5040, 1.0 / 362880, -1.0 / 39916800});
}
inline double cos_kernel(double r) {
  const double z = r * r;
  return 1 +
         z * polynomial(z, {-1.0 / 2, 1.0 / 24, -1.0 / 720, 1.0 / 40320, -1.0 / 3628800, 1.0 / 479001600});
}

// 0 <= t <= 1; interpolated at Chebyshev nodes in t^2 on [0, tan^2(pi/8)], relative error 8e-13.
inline double atan_unit(double t) {
  double offset = 0;
  if (t > 0.41421356237309503) {  // tan(pi/8)
    offset = std::numbers::pi / 4;
    t = (t - 1) / (t + 1);
  }
  const double z = t * t;
  return offset + t * polynomial(z, {0.9999999999992391151, -0.3333333327655745325, 0.199999930155473431,
                                     -0.142853850858703831, 0.1110343015597246693, -0.08992304486517335906,
                                     0.06973061114961837222, -0.03763478870532543169});
}

// 0 <= t <= 1/2; the same in t^2 on [0, 1/4], relative error 7e-14.
inline double asin_half(double t) {
  return t * polynomial(t * t, {0.9999999999999490068, 0.1666666667073998438, 0.07499999465541900418,
                                0.04464312779563018653, 0.03037502667647575053, 0.02247288165789139851,
                                0.01647089319807749652, 0.01864632813452648469, -0.002874145509656020009,
                                0.03196080310674930756});
}

// exp for float results: relative error below 1e-10, |x| <= 700.
inline double exp_single(double x) {
  const double n = std::nearbyint(x * std::numbers::log2e);
  const double r = x - n * std::numbers::ln2;
  const double p = polynomial(
      r, {1.0, 1.0, 1.0 / 2, 1.0 / 6, 1.0 / 24, 1.0 / 120, 1.0 / 720, 1.0 / 5040, 1.0 / 40320, 1.0 / 362880});
  return p * pow2(static_cast<std::int64_t>(n));
}

// x = 2^k m with m in [sqrt(1/2), sqrt(2)); x normal and positive.
inline double split_exponent(double x, std::int64_t& k) {
  std::uint64_t bits = std::bit_cast<std::uint64_t>(x);
  constexpr std::uint64_t kSqrtHalf = 0x3fe6a09e667f3bcdULL;
  const std::uint64_t shifted = bits - kSqrtHalf;
  k = static_cast<std::int64_t>(shifted) >> 52;
  bits -= static_cast<std::uint64_t>(k) << 52;
  return std::bit_cast<double>(bits);
}

// log for float results: relative error below 1e-10.
inline double log_single(double x) {
  std::int64_t k = 0;
  const double f = split_exponent(x, k) - 1;
  const double s = f / (2 + f);
  const double z = s * s;
  const double series = polynomial(z, {2.0, 2.0 / 3, 2.0 / 5, 2.0 / 7, 2.0 / 9, 2.0 / 11, 2.0 / 13});
  return static_cast<double>(k) * std::numbers::ln2 + s * series;
}

}  // namespace detail

inline void sincosf(float x, float& sine, float& cosine) {
  std::uint64_t quadrant = 0;
  const double r = detail::reduce_quadrant(x, quadrant);
  const double s = detail::sin_kernel(r);
  const double c = detail::cos_kernel(r);
  const bool swapped = (quadrant & 1) != 0;
  const double a = swapped ? c : s;
  const double b = swapped ? s : c;
  sine = static_cast<float>((quadrant & 2) != 0 ? -a : a);
  cosine = static_cast<float>(((quadrant + 1) & 2) != 0 ? -b : b);
}
inline float sinf(float x) {
  float s = 0;
  float c = 0;
  sincosf(x, s, c);
  return s;
}
inline float cosf(float x) {
  float s = 0;
  float c = 0;
  sincosf(x, s, c);
  return c;
}
inline float tanf(float x) {
  std::uint64_t quadrant = 0;
  const double r = detail::reduce_quadrant(x, quadrant);
  const double s = detail::sin_kernel(r);
  const double c = detail::cos_kernel(r);
  return static_cast<float>((quadrant & 1) != 0 ? -c / s : s / c);
}

inline float asinf(float x) {
  const double a = std::abs(static_cast<double>(x));
  double result = 0;
  if (a <= 0.5) {
    result = detail::asin_half(a);
  } else if (a < 1) {
    result = std::numbers::pi / 2 - 2 * detail::asin_half(std::sqrt((1 - a) / 2));
  } else {
    result = a != a ? a : std::numbers::pi / 2;
  }
  return static_cast<float>(std::copysign(result, static_cast<double>(x)));
}
inline float acosf(float x) {
  const double v = x;
  if (v > 0.5) return v < 1 ? static_cast<float>(2 * detail::asin_half(std::sqrt((1 - v) / 2))) : 0.0f;
  if (v < -0.5) {
    return v > -1 ? static_cast<float>(std::numbers::pi - 2 * detail::asin_half(std::sqrt((1 + v) / 2)))
                  : kPi;
  }
  return static_cast<float>(std::numbers::pi / 2 - std::copysign(detail::asin_half(std::abs(v)), v));
}

inline float atan2f(float y, float x) {
  const double ay = std::abs(static_cast<double>(y));
  const double ax = std::abs(static_cast<double>(x));
  if (ax != ax || ay != ay) return x + y;
  const bool steep = ay > ax;
  const double low = steep ? ax : ay;
  const double high = steep ? ay : ax;
  double t = 0;                                      // both zero: 0
  if (high > 0) t = low == high ? 1.0 : low / high;  // equal: also where both are infinite
  double angle = detail::atan_unit(t);
  if (steep) angle = std::numbers::pi / 2 - angle;
  if (std::signbit(x)) angle = std::numbers::pi - angle;
  return static_cast<float>(std::copysign(angle, static_cast<double>(y)));
}
inline float atanf(float x) {
  return atan2f(x, 1.0f);
}

inline float expf(float x) {
  if (!(x > -110.0f)) return x != x ? x : 0.0f;
  if (x > 90.0f) return std::numeric_limits<float>::infinity();
  return static_cast<float>(detail::exp_single(x));
}
inline float logf(float x) {
  if (!(x > 0))
    return x == 0 ? -std::numeric_limits<float>::infinity() : std::numeric_limits<float>::quiet_NaN();
  if (x == std::numeric_limits<float>::infinity()) return x;
  return static_cast<float>(detail::log_single(x));
}

}  // namespace candela::math
