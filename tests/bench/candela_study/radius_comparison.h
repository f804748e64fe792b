// Ways to choose the radius, compared on the analytic scenes at equal iterations.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/job/job.h"
#include "tests/bench/candela_study/analytic_scenes.h"
#include "tests/bench/candela_study/renders.h"
#include "tests/bench/candela_study/study.h"

namespace candela::study {

struct RadiusComparison {
  std::string part;
  std::vector<Method> methods;
  std::uint64_t iterations = 1024;
  std::vector<std::string> scenes = {};  // names; empty: all
};

// Errors of each scene and method, after 1/64, 1/8 and all of the iterations, relative to the mean of the
// picture: "squared error", "variance", "squared bias" (two seeds or more); of integrators with epochs also
// what the rule tells of the last state, its map of radii (from the first seed), and two shares of the
// pixels, by the bias and the noise that N iterations of one radius have:
//   "false positives"  the radius has shrunk, and a disc of twice the area (at most the first) would have a
//                      bias below 1 standard error
//   "false negatives"  the bias is above 3 standard errors
// with a map that is 1 at the former and -1 at the latter. The method "best fixed radius" is the least
// squared error of constant radii in hindsight.
Result<Results> compare_radii(const Request& request, const RadiusComparison& comparison);

// The bias of the constant kernel of this radius over the mean of the field, for each pixel, from points *
// points places in it.
std::vector<double> relative_bias(const AnalyticScene& scene, std::uint32_t side, double radius,
                                  int points = 1);

// 1, -1 or 0 of a pixel whose radius is `factor` times the first. bias(f): that of the radius f times the
// first; noise: the standard error of the first radius; both in one unit.
template <class Bias>
float decision(double factor, const Bias& bias, double noise) {
  const auto errors = [&](double f) { return std::fabs(bias(f)) * f / noise; };
  if (errors(factor) > 3) return -1;
  return factor < 0.999 && errors(std::min(1.0, factor * std::numbers::sqrt2)) < 1 ? 1 : 0;
}

}  // namespace candela::study
