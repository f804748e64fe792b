// Radii that shrink by a schedule (ppm), by counts of photons (cppm), by the F test (fppm) and by a plug-in
// bandwidth (appm), with their variants, on scenes with known pictures: Fig. 6 to 8 of Lin et al., with the
// truth in place of a reference.
#include "tests/bench/candela_study/radius_comparison.h"

namespace candela::study {

Result<Results> run_fppm_comparison(const Request& request) {
  return compare_radii(request, {"fppm-comparison",
                                 {{"ppm", "ppm"},
                                  {"ppm 3/4", "ppm", {{"alpha", "0.75"}}},
                                  {"cppm", "cppm"},
                                  {"cppm 5 %", "cppm", {{"alpha_chi", "0.05"}}},
                                  {"fppm", "fppm"},
                                  {"fppm 5 %", "fppm", {{"alpha_f", "0.05"}}},
                                  {"appm", "appm"},
                                  {"appm reference", "appm", {{"pilot", "reference"}}}}});
}

// The same with states of which 0, 1 or 4 epochs lie between their sums and their use.
Result<Results> run_lag(const Request& request) {
  RadiusComparison comparison{"lag",
                              {{"lag 0", "fppm", {{"lag", "0"}}},
                               {"lag 1", "fppm", {{"lag", "1"}}},
                               {"lag 4", "fppm", {{"lag", "4"}}}}};
  comparison.iterations = 1024;
  comparison.scenes = {"flat", "curvature", "edge"};
  return compare_radii(request, comparison);
}

}  // namespace candela::study
