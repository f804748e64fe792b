// Double elementary functions from the pieces the float ones are made of (relative error below 1e-12).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "worker/core/math.h"

namespace candela::scene {

inline double asin_double(double x) {
  const double a = std::min(std::abs(x), 1.0);
  const double r = a <= 0.5 ? math::detail::asin_half(a)
                            : std::numbers::pi / 2 - 2 * math::detail::asin_half(std::sqrt((1 - a) / 2));
  return std::copysign(r, x);
}

inline void sincos_double(double x, double& sine, double& cosine) {
  std::uint64_t quadrant = 0;
  const double r = math::detail::reduce_quadrant(x, quadrant);
  const double s = math::detail::sin_kernel(r), c = math::detail::cos_kernel(r);
  const double a = (quadrant & 1) != 0 ? c : s, b = (quadrant & 1) != 0 ? s : c;
  sine = (quadrant & 2) != 0 ? -a : a;
  cosine = ((quadrant + 1) & 2) != 0 ? -b : b;
}

}  // namespace candela::scene
