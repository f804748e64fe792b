#include "common/adaptive/plug_in.h"

#include <algorithm>
#include <cmath>

namespace candela::adaptive {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kPilotFactor = 0.95760328069857365;  // 2^(-1/16)

double sixth_power(double x) {
  const double cube = x * x * x;
  return cube * cube;
}

}  // namespace

double plug_in_constant(double k2, double k3) {
  return 2 * kPi * k3 / (k2 * k2);
}

PlugInMedia plug_in_media(double disc_k2, double ball_k2, double ball_k3) {
  return {4 * kPi * ball_k3 / (disc_k2 * disc_k2), ball_k2 / disc_k2};
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

double pilot_bandwidth(std::uint64_t begin) {
  const auto n = static_cast<double>(std::max<std::uint64_t>(begin, 1));
  return 0.5 / fifth_root(std::sqrt(n));
}

double reference_constant(double k2, double energy) {
  const double bias = 0.5 + 4 * k2;
  return kPi * 3 * energy / (2 * bias * bias);
}

double pilot_of_level(int level) {
  double h = 0.5;
  for (int g = 0; g < level; ++g) h *= kPilotFactor;
  return h;
}

ReferencePilot::ReferencePilot(double c10) : c10_(c10) {
  const double root = std::sqrt(kPilotFactor);
  for (int g = 0; g + 1 < kPilotLevels; ++g) {
    const double border = pilot_of_level(g) * root;
    const double square = border * border;
    thresholds_.push_back(square * square * square * square * square);
  }
}

int ReferencePilot::level(double a1, double a2, double d1, int present) const {
  if (!(a1 > 0) || !(a2 > 0)) return present;
  const double slope = std::fabs(d1);
  const double z = a1 < 2 * slope ? 2 * a1 / slope : 4;
  const double h10 = c10_ * (z * z) * (z * z) * a2 / (a1 * a1);
  const auto at = std::partition_point(thresholds_.begin(), thresholds_.end(),
                                       [h10](double threshold) { return h10 < threshold; });
  return static_cast<int>(at - thresholds_.begin());
}

PlugIn::PlugIn(const Levels& levels, double c6, double r_min, double r_max, const PlugInMedia& media)
    : c6_(c6),
      r_min_(r_min),
      r_max_(r_max),
      min6_(sixth_power(r_min)),
      max6_(sixth_power(r_max)),
      media_(media),
      max_level_(levels.max_level) {
  const double step = sixth_power(levels.factor);
  double threshold = levels.factor * levels.factor * levels.factor;
  double border = std::sqrt(levels.factor);
  for (int g = 0; g < max_level_; ++g, threshold *= step, border *= levels.factor) {
    thresholds_.push_back(threshold);
    borders_.push_back(border);
  }
}

int PlugIn::level(double a2, double d1, std::uint64_t iterations, int present) const {
  if (!(a2 > 0) || iterations == 0) return present;
  const auto n = static_cast<double>(iterations);
  const double r6 = d1 != 0 ? std::clamp(c6_ * a2 / (d1 * d1), min6_ / n, max6_ / n) : max6_ / n;
  const auto at = std::partition_point(thresholds_.begin(), thresholds_.end(),
                                       [r6](double threshold) { return r6 < threshold; });
  return static_cast<int>(at - thresholds_.begin());
}

int PlugIn::level(double a2, double d1, double medium_a2, double medium_d1, std::uint64_t iterations,
                  int present) const {
  if (!(medium_a2 > 0)) return level(a2, d1, iterations, present);
  if (iterations == 0) return present;
  const auto n = static_cast<double>(iterations);
  const double laplacian = d1 + media_.k2_ratio * medium_d1;
  const bool surfaces = a2 > 0;
  const auto above = [&](double border) {  // the radius is below this border
    const double to_min = border / r_min_, to_max = border / r_max_;
    const double min = n * sixth_power(to_min) * (surfaces ? 1 : to_min);
    const double max = n * sixth_power(to_max) * (surfaces ? 1 : to_max);
    const double best =
        sixth_power(border) * laplacian * laplacian - c6_ * a2 - media_.c7 * medium_a2 / border;
    return (best > 0 || max > 1) && min > 1;
  };
  const auto at = std::partition_point(borders_.begin(), borders_.end(), above);
  return static_cast<int>(at - borders_.begin());
}

}  // namespace candela::adaptive
