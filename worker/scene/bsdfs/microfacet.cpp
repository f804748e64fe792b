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

// The visible slopes along the view have the cumulative distribution G(x) / G(cot theta),
//   G(x) = cos theta (1 + erf x) + sin theta / sqrt(pi) exp(-x^2),  x <= cot theta,
// whose derivative is 2/sqrt(pi) exp(-x^2) (cos theta - x sin theta). (Multiplied through by cos theta of
// [Heitz and d'Eon 2014]: finite at grazing angles, where it becomes Rayleigh's.) For x < 0, exp(-x^2) is
// factored out, so that the far tail keeps its digits; there Newton's method runs on log G, elsewhere on G,
// inside a bracket that only shrinks.
double sample_beckmann_visible_slope(double cos_theta, double sin_theta, double u) {
  constexpr double kInvSqrtPi = 0.5641895835477562869;
  const auto gauss = [](double x) { return math::detail::exp_single(-x * x); };
  const auto cumulative = [&](double x, double g) {
    const double q = g * math::erfcx(std::abs(x));  // erfc |x|
    return cos_theta * (x < 0 ? q : 2 - q) + sin_theta * kInvSqrtPi * g;
  };
  const double limit = 6;
  double high = cos_theta < limit * sin_theta ? cos_theta / sin_theta : limit;
  double low = -limit;
  const double target = std::max(u, 0x1p-26) * cumulative(high, gauss(high));
  // Start: the answer for normal view (an error function) and for grazing view (Rayleigh's) blended by the
  // sine.
  const double rayleigh = -std::sqrt(-math::detail::log_single(std::max(u, 0x1p-26)));
  const double normal = math::erfinvf(static_cast<float>(std::max(2 * u - 1, -1 + 0x1p-24)));
  double x = std::clamp(cos_theta * normal + (1 - cos_theta) * rayleigh, low, high);
  for (int i = 0; i < 30; ++i) {
    const double g = gauss(x);
    const double value = cumulative(x, g);
    if (value > target) {
      high = x;
    } else {
      low = x;
    }
    const double slope = 2 * kInvSqrtPi * g * (cos_theta - x * sin_theta);
    double next = 0;
    if (x < 0) {
      next = x - math::detail::log_single(value / target) * value / slope;
    } else {
      next = x - (value - target) / slope;
    }
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    const double step = next - x;
    x = next;
    if (std::abs(step) < 1e-7) break;
  }
  return x;
}

}  // namespace candela::scene
