#include "common/adaptive/plug_in.h"

#include <algorithm>
#include <cmath>

namespace candela::adaptive {
namespace {

constexpr double kPi = 3.14159265358979323846;

double sixth_power(double x) {
  const double cube = x * x * x;
  return cube * cube;
}

}  // namespace

double plug_in_constant(double k2, double k3, bool recursive) {
  return 2 * kPi * k3 / (k2 * k2) / (recursive ? 3 : 1);
}

int laplacian_stencil(double u, double v, double h) {
  const auto inside = [&](double cu, double cv) {
    const double du = u - cu, dv = v - cv;
    return du * du + dv * dv < h * h ? 1 : 0;
  };
  return inside(h, 0) + inside(-h, 0) + inside(0, h) + inside(0, -h) - 4 * inside(0, 0);
}

double fifth_root(double x) {
  double scale = 1;
  for (; x < 1; x *= 32) scale *= 0.5;
  for (; x >= 32; x /= 32) scale *= 2;
  double y = 2;  // from above, for 1 <= x < 32: the steps descend
  for (;;) {
    const double square = y * y;
    const double next = (4 * y + x / (square * square)) / 5;
    if (!(next < y)) return y * scale;
    y = next;
  }
}

double pilot_bandwidth(Pilot pilot, std::uint64_t begin) {
  const auto n = static_cast<double>(std::max<std::uint64_t>(begin, 1));
  const double root = std::sqrt(n);
  return 0.5 / (pilot == Pilot::tenth ? fifth_root(root) : std::sqrt(std::sqrt(root)));
}

PlugIn::PlugIn(const Levels& levels, double c6, double r_min, double r_max)
    : c6_(c6), min6_(sixth_power(r_min)), max6_(sixth_power(r_max)), max_level_(levels.max_level) {
  const double step = sixth_power(levels.factor);
  double threshold = levels.factor * levels.factor * levels.factor;
  for (int g = 0; g < max_level_; ++g, threshold *= step) thresholds_.push_back(threshold);
}

int PlugIn::level(double a2, double d1, std::uint64_t iterations, int present) const {
  if (!(a2 > 0) || iterations == 0) return present;
  const auto n = static_cast<double>(iterations);
  const double r6 = d1 != 0 ? std::clamp(c6_ * a2 / (d1 * d1), min6_ / n, max6_ / n) : max6_ / n;
  const auto at = std::partition_point(thresholds_.begin(), thresholds_.end(),
                                       [r6](double threshold) { return r6 < threshold; });
  return static_cast<int>(at - thresholds_.begin());
}

}  // namespace candela::adaptive
