// Ways to choose the radius, compared on the analytic scenes at equal iterations.
#pragma once

#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/job/job.h"
#include "tests/bench/candela_study/analytic_scenes.h"
#include "tests/bench/candela_study/study.h"

namespace candela::study {

struct RadiusMethod {
  std::string name;
  std::string integrator;
  SettingsMap settings = {};
};

struct RadiusComparison {
  std::string part;
  std::vector<RadiusMethod> methods;
  std::uint64_t iterations = 4096;
  std::vector<std::string> scenes = {};  // names; empty: all
};

// Of each scene and method, after 1/64, 1/8 and all of the iterations, relative to the mean of the picture:
// "squared error", "variance", "squared bias" (two seeds or more); of integrators with epochs also what
// the rule tells of the last state, its map of radii (from the first seed), and
//   "false shrinks"  share of the pixels with a bias below 1 % at the first radius whose radius has shrunk
//   "missed"         share of the pixels with a bias above 10 % there whose radius has not
// if there are such pixels. The method "best fixed radius" is the least squared error of constant radii
// in hindsight.
Result<Results> compare_radii(const Request& request, const RadiusComparison& comparison);

// The bias of the constant kernel of this radius over the field, for each pixel.
std::vector<double> relative_bias(const AnalyticScene& scene, std::uint32_t side, double radius);

}  // namespace candela::study
