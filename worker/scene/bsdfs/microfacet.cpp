// The Beckmann distribution's two functions that need the error function. See microfacet.h.
#include "worker/scene/bsdfs/microfacet.h"

namespace candela::scene {

// Lambda(a) = (exp(-a^2) / (a sqrt(pi)) - erfc(a)) / 2 = exp(-a^2) / 2 (1 / (a sqrt(pi)) - erfcx(a)) [Walter
// 2007, Eq. 23]
float beckmann_masking(float a) {
  if (a >= 4) return 1;  // Lambda < 1e-9
  const double x = a;
  const double lambda = 0.5 * math::detail::exp_single(-x * x) * (0.5641895835477562869 / x - math::erfcx(x));
  return static_cast<float>(1 / (1 + std::max(0.0, lambda)));
}

// In q = 1 + erf x, half the fraction of all slopes below x, the visible slopes along the view have the
// cumulative distribution G(q) / G(q_max),
//   G(q) = cos theta q + sin theta / sqrt(pi) exp(-x(q)^2),  x <= cot theta,
// the form of [Heitz and d'Eon 2014] times cos theta, finite at grazing angles, where it becomes Rayleigh's.
// Its derivatives are G' = cos theta - x sin theta and G'' = -sin theta sqrt(pi)/2 exp(x^2): rising and
// concave. Halley's steps from a fit [Jakob 2014, his in the sine] close in on the root; two do nearly
// always.
double sample_beckmann_visible_slope(double cos_theta, double sin_theta, double u) {
  constexpr double kInvSqrtPi = 0.5641895835477562869;
  constexpr double kHalfSqrtPi = 0.8862269254527580137;
  constexpr double kMin =
      1e-10;  // below the first quantile that a 24-bit number can ask for, 2^-26 at grazing
  double q_max = 2;
  double gauss_max = 0;
  if (cos_theta < 5 * sin_theta) {
    const double cot = cos_theta / sin_theta;
    gauss_max = math::detail::exp_single(-cot * cot);
    q_max = 2 - gauss_max * math::erfcx(cot);
  }
  u = std::max(u, 0x1p-26);
  const double target = u * (cos_theta * q_max + sin_theta * kInvSqrtPi * gauss_max);
  const double fit = 1 - sin_theta * (0.85 - 0.3 * sin_theta);
  double q = q_max * (1 - math::detail::exp_single(fit * math::detail::log_single(1 - u)));
  for (int i = 0;; ++i) {
    q = std::clamp(q, kMin, 2 - kMin);
    const double gauss_weight = q * (2 - q);  // 1 - erf^2
    const double x = (q - 1) * math::detail::erfinv_ratio(-math::detail::log_single(gauss_weight));
    const double g = math::detail::exp_single(-x * x);
    const double slope = std::max(cos_theta - x * sin_theta, 1e-9);
    const double dx_dq = kHalfSqrtPi / g;
    const double newton = (cos_theta * q + sin_theta * kInvSqrtPi * g - target) / slope;
    // Halley's correction 1 - newton G'' / (2 G'), kept from turning or exploding the step.
    const double step = newton / std::clamp(1 + 0.5 * newton * sin_theta * dx_dq / slope, 0.5, 4.0);
    // x moves along by its own second-order expansion in q.
    const double dx = -dx_dq * step;
    if (std::abs(dx) < 2e-3 || i == 20) return x + dx + x * dx * dx;
    q -= step;
  }
}

}  // namespace candela::scene
