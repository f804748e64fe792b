#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>

#include "tests/bench/candela_study/study.h"

namespace candela::study {
namespace {

constexpr std::array kStudies = {
    Study{"bias-aware",
          "the bias-aware balance heuristic, the plain one and their bounds on known integrands",
          "Hachisuka 2012, supplement, sections B to D", 0, 0, run_bias_aware},
    Study{"fppm-comparison",
          "radii by schedule, counts, F test and plug-in bandwidth on scenes with known pictures",
          "Lin 2023, Fig. 6 to 8", 3, 2, run_fppm_comparison, false, true},
    Study{"fppm-scenes", "ppm, cppm and fppm from equal first radii on seven scenes", "Lin 2023, Fig. 6 to 8",
          2, 1, run_fppm_scenes, false, true},
    Study{"lag", "the F test with states that lie 0, 1 and 4 epochs back", "Lin 2023, on a farm", 3, 2,
          run_lag},
    Study{"metropolis-photons",
          "ppm, mcppm and vcm over the share of light paths that leave photons in the picture",
          "Hachisuka 2011", 2, 2, run_metropolis_photons},
    Study{"mis-1d",
          "weights, variances and estimators of optimal multiple importance sampling on known integrals",
          "Kondapaneni 2019, supplement, Fig. 1 and section 3", 0, 0, run_mis_1d},
    Study{"mis-scenes",
          "error of direct light by every heuristic and by optimal weights, at equal samples and time",
          "Kondapaneni 2019, section 8", 4, 2, run_mis_scenes, false, true},
    Study{"regularisation",
          "light that no technique samples, by mollified connections and by merging, in equal time",
          "Kaplanyan 2017, Fig. 6.4 and 6.6", 3, 2, run_regularisation, true},
    Study{"upbp-nsd", "spread of the 25 estimators with points and beams in a medium against kernel width",
          "Krivanek 2014, Fig. 1", 0, 0, run_upbp_nsd},
    Study{"upbp-scenes", "error of the techniques of upbp, alone and together, in equal time",
          "Krivanek 2014, Fig. 9 to 11", 4, 2, run_upbp_scenes, true},
    Study{"ups-alpha", "error, variance and bias of ppm and vcm against alpha, on a torus in glass",
          "Hachisuka 2012, supplement, Fig. 1 and Eq. 46", 3, 2, run_ups_alpha},
    Study{"vcmplus-table", "iterations and time of vcm and vcmplus to equal error",
          "Lin 2023, Tables I to III and Fig. 14", 3, 2, run_vcmplus_table, true},
};

}  // namespace

std::span<const Study> studies() {
  return kStudies;
}

Result<void> check_scenes(const Request& request, const std::vector<std::string>& known) {
  for (const std::string& name : request.scenes)
    if (std::find(known.begin(), known.end(), name) == known.end())
      return usage_error(fmt::format("there is no scene '{}'", name))
          .with_field("--scenes")
          .with_mend(fmt::format("some of {}", fmt::join(known, ", ")));
  return {};
}

const Study* find_study(std::string_view name) {
  const auto found =
      std::find_if(kStudies.begin(), kStudies.end(), [&](const Study& s) { return s.name == name; });
  return found == kStudies.end() ? nullptr : &*found;
}

}  // namespace candela::study
