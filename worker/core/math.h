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
float logf(float x);                                  // x > 0; -inf at 0, NaN below
double exp(double x);                                 // <= 2 ulp of double
double log(double x);                                 // <= 2 ulp of double
double pow(double x, double y);                       // x >= 0; relative error <= 1e-13 for results in range
double atan2(double y, double x);                     // <= 4 ulp of double; signs as atan2f
void sincos(double x, double& sine, double& cosine);  // |x| <= 1000: absolute errors <= 1e-15
double srgb_to_linear(double v);                      // IEC 61966-2-1
float erfinvf(float x);                               // +-inf at +-1, NaN beyond
double erfcx(double x);  // exp(x^2) erfc(x) for x >= 0; relative error <= 1e-11 up to 11

namespace detail {

// Estrin's scheme: c[0] + c[1] x + ... in about log2(N) dependent steps.
template <std::size_t N>
[[gnu::always_inline]] inline double polynomial(double x, const double (&c)[N]) {
  if constexpr (N == 1) {
    return c[0];
  } else if constexpr (N == 2) {
    return c[0] + c[1] * x;
  } else {
    double half[(N + 1) / 2];
    for (std::size_t i = 0; i < N / 2; ++i) half[i] = c[2 * i] + c[2 * i + 1] * x;
    if constexpr (N % 2 == 1) half[N / 2] = c[N - 1];
    return polynomial(x * x, half);
  }
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

// erfinv(x) / x as a function of w = -log(1 - x^2), 0 <= w <= 24; interpolated at Chebyshev nodes, in w below
// 6 and in sqrt(w) above [after Giles 2012]; relative error below 1e-9.
inline double erfinv_ratio(double w) {
  if (w < 6) {
    return polynomial(w - 3, {1.623542006464829912, 0.2416304018724780887, -0.005738135424204099935,
                              -0.0008361745723989565165, 0.0001950619522305495975, -0.00001272297993373456303,
                              -1.748550295446642487e-6, 4.52594064718514486e-7, -2.3487272151417536e-8,
                              -5.9891513759872462e-9, 1.076257140475986409e-9, 2.256618542030035299e-11,
                              -1.48549089616377645e-11});
  }
  return polynomial(
      std::sqrt(w) - 3.6,
      {3.436253406603615173, 1.007966351691572744, 0.002717327642742025092, -0.001685979415916413783,
       0.0008108506665758719675, -0.0004638933367822803203, 0.0002939375795321504138,
       -0.0001668373538160952749, 0.00007055580786639275421, -0.00001312605151716560723,
       -7.214824062903172011e-6, 5.842106001338417105e-6, -1.271186560736318083e-6});
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

// (1 + 2x) erfcx(x) is smooth in t = (x - K) / (x + K), K = 3.75 [Shepherd and Laframboise 1981];
// interpolated at Chebyshev nodes for t in [-1, 1/2], relative error 4e-12.
inline double erfcx(double x) {
  if (x > 11) {  // asymptotic
    const double z = 1 / (x * x);
    return 0.5641895835477562869 / x * (1 - z * (0.5 - z * (0.75 - z * 1.875)));
  }
  const double t = (x - 3.75) / (x + 3.75);
  return detail::polynomial(t,
                            {1.237512630840941882, -0.1402405986124649626, 0.003585414778819327667,
                             0.08227674017022456986, -0.1088039030397751214, 0.09230430317685181437,
                             -0.0586937910719319149, 0.02836214854055043961, -0.009744013394864714054,
                             0.001758346697993612516, 0.0002866809642271561419, -0.0003032500864505333638,
                             0.00005416807178480120211, 0.00004225568072172799573, 2.758415132493640716e-6}) /
         (1 + 2 * x);
}

inline float erfinvf(float x) {
  const double v = x;
  if (!(std::abs(v) < 1)) {
    if (std::abs(v) == 1) return std::copysign(std::numeric_limits<float>::infinity(), x);
    return std::numeric_limits<float>::quiet_NaN();
  }
  return static_cast<float>(v * detail::erfinv_ratio(-detail::log_single((1 - v) * (1 + v))));
}

}  // namespace candela::math
