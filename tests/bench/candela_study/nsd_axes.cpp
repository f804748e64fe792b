#include "tests/bench/candela_study/nsd_axes.h"

#include <algorithm>
#include <cmath>

namespace candela::study {
namespace {

bool blurred(AxisKind kind) {
  return kind == AxisKind::blurred_short_beam || kind == AxisKind::blurred_long_beam;
}

// "s" or "l".
std::string length_name(AxisKind kind) {
  return kind == AxisKind::short_beam || kind == AxisKind::blurred_short_beam ? "s" : "l";
}

std::string name_of(AxisKind light, AxisKind eye) {
  if (light == AxisKind::point && eye == AxisKind::point) return "P-P3D";
  if (light == AxisKind::point)
    return std::string(blurred(eye) ? "P-B3D" : "P-B2D") + "[" + length_name(eye) + "]";
  if (eye == AxisKind::point)
    return std::string(blurred(light) ? "B-P3D" : "B-P2D") + "[" + length_name(light) + "]";
  const std::string family = blurred(light) && blurred(eye) ? "B-B3D"
                             : blurred(light)               ? "B-B2Dlight"
                             : blurred(eye)                 ? "B-B2Deye"
                                                            : "B-B1D";
  return family + "[" + length_name(light) + length_name(eye) + "]";
}

// (u - 1 + e^-u) / u^2, whose numerator cancels for small u.
double window_moment(double u) {
  return u < 1e-3 ? 0.5 - u / 6 + u * u / 24 : (u - 1 + std::exp(-u)) / (u * u);
}

double ratio_fixed(AxisKind kind, double depth, double u) {
  const double before = depth - 0.5 * u, hit = -std::expm1(-u);
  switch (kind) {
    case AxisKind::point:
      return std::exp(before) / hit;
    case AxisKind::short_beam:
      return std::exp(depth);
    case AxisKind::blurred_short_beam:
      return 2 * std::exp(before) * (1 - (1 + u) * std::exp(-u)) / (hit * hit);
    case AxisKind::long_beam:
    case AxisKind::blurred_long_beam:
      return 1;
  }
  return 0;
}

double ratio_uniform(AxisKind kind, double interval, double u) {
  switch (kind) {
    case AxisKind::point:
      return interval / u;
    case AxisKind::short_beam:
      return interval;
    case AxisKind::long_beam:
      return interval / 2;
    case AxisKind::blurred_short_beam:
      return 2 * interval * window_moment(u);
    case AxisKind::blurred_long_beam:
      return interval * window_moment(u);
  }
  return 0;
}

}  // namespace

const std::vector<NsdEstimator>& nsd_estimators() {
  static const std::vector<NsdEstimator> all = [] {
    const std::vector<AxisKind> kinds = {AxisKind::point, AxisKind::short_beam, AxisKind::long_beam,
                                         AxisKind::blurred_short_beam, AxisKind::blurred_long_beam};
    std::vector<NsdEstimator> made;
    for (const AxisKind light : kinds)
      for (const AxisKind eye : kinds) made.push_back({name_of(light, eye), light, eye});
    return made;
  }();
  return all;
}

double axis_mean(AxisKind kind, const Crossing& crossing, double u) {
  const bool unblurred = kind == AxisKind::short_beam || kind == AxisKind::long_beam;
  return !crossing.fixed || unblurred ? 1 : std::sinh(u / 2) / (u / 2);
}

double axis_ratio(AxisKind kind, const Crossing& crossing, double u) {
  return crossing.fixed ? ratio_fixed(kind, crossing.depth, u) : ratio_uniform(kind, crossing.depth, u);
}

double nsd(const NsdEstimator& estimator, const Crossing& crossing, double u, double offsets) {
  return nsd_of_many(estimator, crossing, u, offsets, 1);
}

double nsd_of_many(const NsdEstimator& estimator, const Crossing& crossing, double u, double offsets,
                   double paths) {
  const double light = axis_ratio(estimator.light, crossing, u), eye = axis_ratio(estimator.eye, crossing, u);
  return std::sqrt(std::max(0.0, (light * eye * offsets / u - eye) / paths + eye - 1));
}

}  // namespace candela::study
