#include "worker/transport/radius.h"

#include <cmath>

#include "worker/core/math.h"

namespace candela::transport {
namespace {

// Products up to here are taken factor by factor.
constexpr std::uint64_t kLiteral = 64;

// Gamma(n + alpha) / Gamma(n + 1), for n >= kLiteral: with w = n + alpha / 2 it is w^(alpha - 1) times a
// series in w^-2 [Tricomi 1951]; the first term left out is below 3e-14 of the sum.
double gamma_ratio(double n, double alpha) {
  const double w = n + alpha / 2;
  const double z = 1 / (w * w);
  // C(alpha - 1, 2 j) B_2j^(alpha)(alpha / 2) for j = 1, 2.
  const double pairs = (alpha - 1) * (alpha - 2) / 2;
  const double c1 = -pairs * alpha / 12;
  const double c2 = pairs * (alpha - 3) * (alpha - 4) / 12 * (alpha / 120 + alpha * alpha / 48);
  return math::pow(w, alpha - 1) * (1 + z * (c1 + z * c2));
}

}  // namespace

double shrinkage(std::uint64_t iteration, double alpha) {
  const std::uint64_t last = iteration < kLiteral ? iteration : kLiteral;
  double product = 1;
  for (std::uint64_t k = 1; k <= last; ++k) {
    const auto kd = static_cast<double>(k);
    product *= (kd + alpha) / (kd + 1);
  }
  if (iteration <= kLiteral) return product;
  // The product is a ratio of Gamma functions [Knaus 2011]: Gamma(i + 1 + alpha) / Gamma(i + 2) over a
  // constant that the literal part fixes, so Gamma(1 + alpha) is not needed.
  const double n = static_cast<double>(iteration) + 1;
  return product * (gamma_ratio(n, alpha) / gamma_ratio(static_cast<double>(kLiteral) + 1, alpha));
}

double disc_radius(double first_radius, std::uint64_t iteration, double alpha) {
  return first_radius * std::sqrt(shrinkage(iteration, alpha));
}

double ball_radius(double first_radius, std::uint64_t iteration, double alpha) {
  return first_radius * math::pow(shrinkage(iteration, alpha), 1.0 / 3);
}

double blur_radius(double first_radius, std::uint64_t iteration, int dimension) {
  return first_radius * math::pow(static_cast<double>(iteration) + 1, -1.0 / (4 + dimension));
}

}  // namespace candela::transport
