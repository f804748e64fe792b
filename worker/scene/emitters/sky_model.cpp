#include "worker/scene/emitters/sky_model.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "worker/core/math.h"
#include "worker/scene/emitters/double_math.h"

namespace candela::scene {
namespace {

constexpr std::size_t kControlPoints = 6;

// Bernstein polynomials of degree 5.
std::array<double, kControlPoints> bernstein(double x) {
  const double y = 1 - x;
  return {y * y * y * y * y,      5 * x * y * y * y * y, 10 * x * x * y * y * y,
          10 * x * x * x * y * y, 5 * x * x * x * x * y, x * x * x * x * x};
}

}  // namespace

SkyModel::SkyModel(double turbidity, const Vec3d& albedo, double elevation) {
  // Between these nothing was measured, and the curves, steep in the elevation there, are left free by the
  // fit.
  constexpr double kLow = std::numbers::pi / 180;
  if (elevation < kLow) {
    add(turbidity, albedo, 0, 1 - elevation / kLow);
    add(turbidity, albedo, kLow, elevation / kLow);
  } else {
    add(turbidity, albedo, elevation, 1);
  }
}

void SkyModel::add(double turbidity, const Vec3d& albedo, double elevation, double share) {
  const std::array<double, kControlPoints> basis =
      bernstein(std::clamp(math::pow(std::max(elevation, 0.0) / (std::numbers::pi / 2), 1.0 / 3), 0.0, 1.0));
  const double from = std::clamp(turbidity, 1.0, 10.0) - 1;
  const auto low = std::min<std::size_t>(static_cast<std::size_t>(from), 8);
  for (std::size_t channel = 0; channel < 3; ++channel)
    for (const std::size_t t : {low, low + 1})
      for (std::size_t white = 0; white < 2; ++white) {
        const double of_turbidity = 1 - std::abs(from - static_cast<double>(t));
        const double reflected = std::clamp(albedo[static_cast<int>(channel)], 0.0, 1.0);
        const double weight = share * of_turbidity * (white == 1 ? reflected : 1 - reflected);
        if (!(weight > 0)) continue;
        std::array<double, 10> value{};
        for (std::size_t k = 0; k < value.size(); ++k)
          for (std::size_t j = 0; j < kControlPoints; ++j)
            value[k] += basis[j] * static_cast<double>(kSkyCoefficients[t][white][channel][k][j]);
        // The fit has these bounds: the horizon has a limit, and so has the light around the sun.
        value[1] = std::min(value[1], 0.0);
        value[7] = std::clamp(value[7], 0.0, 0.98);
        sets_[channel].push_back({value[0], value[1], value[2], value[3], value[4], value[5], value[6],
                                  value[7], value[8], weight * value[9]});
      }
}

// [Hosek and Wilkie 2012, Equations 8 and 9]
Vec3d SkyModel::radiance(double cos_theta, double gamma) const {
  double sine = 0, cos_gamma = 0;
  sincos_double(gamma, sine, cos_gamma);
  const double root = std::sqrt(cos_theta), inverse = 1 / (cos_theta + 0.01);
  std::array<double, 3> sums{};
  for (std::size_t channel = 0; channel < 3; ++channel)
    for (const Perez& p : sets_[channel]) {
      const double square = 1 + p.h * p.h - 2 * p.h * cos_gamma;
      const double mie = (1 + cos_gamma * cos_gamma) / (square * std::sqrt(square));
      sums[channel] += p.scale * (1 + p.a * math::exp(p.b * inverse)) *
                       (p.c + p.d * math::exp(std::clamp(p.e * gamma, -50.0, 50.0)) +
                        p.f * cos_gamma * cos_gamma + p.g * mie + p.i * root);
    }
  return {std::max(0.0, sums[0]), std::max(0.0, sums[1]), std::max(0.0, sums[2])};
}

}  // namespace candela::scene
