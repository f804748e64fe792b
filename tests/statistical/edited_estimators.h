// Estimators of scenes with edits, as tests of edits compare them.
#pragma once

#include <cstdint>
#include <string>
#include <utility>

#include "tests/integrators.h"
#include "tests/statistical/chain_driver.h"
#include "tests/statistical/harness.h"

namespace candela::statistical {

struct EditedWay {
  SettingsMap settings;
  double margin = 0;  // for the bias of merging
  std::uint64_t iterations = 32;
};
inline EditedWay way_of(const std::string& integrator) {
  if (integrator == "ppm") return {{{"radius", "0.06"}}, 0.04, 40};
  if (integrator == "bpm" || integrator == "vcm") return {{{"radius", "0.05"}}, 0.03, 24};
  if (integrator == "light") return {{}, 0, 64};
  if (integrator == "pssmlt" || integrator == "mmlt")
    return {{{"chains", "8"}, {"bootstrap", "16384"}}, 0, 32};
  return {};
}

inline Estimator estimator_of(const std::string& integrator, TestScene scene, const std::string& edits,
                              const Regions& regions, std::uint64_t seed) {
  const EditedWay way = way_of(integrator);
  scene = with_integrator(std::move(scene), integrator, way.settings);
  scene.settings.edits = edits;
  if (test::integrator_row(integrator).chains)
    return make_chain_estimator(integrator, {scene, way.iterations, 2}, seed, 8, regions);
  return make_estimator(integrator, {{1, scene}}, {.seed = seed, .batches = 12, .iterations = way.iterations},
                        regions);
}

}  // namespace candela::statistical
