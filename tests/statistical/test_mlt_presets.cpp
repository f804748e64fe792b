// Presets of mlt against bdpt, which knows nothing of paths as states: mutations beside each other, as users
// run them.
//
// As in test_mlt.cpp a batch is a job of its own; each test alarms falsely with probability at most 1e-5, all
// with at most 1e-3.
#include <gtest/gtest.h>

#include <cstdio>
#include <string>
#include <vector>

#include "tests/proofs/proofs.h"
#include "tests/statistical/chain_driver.h"
#include "tests/statistical/transport_scenes.h"

namespace candela::statistical {
namespace {

// Films decide these tests: proofs.h.
const proofs::FilmsDecide kFilms({"MltPresets"});

constexpr std::uint32_t kExtent = 32;
const Regions kRegions(kExtent, kExtent, 8);
constexpr std::size_t kBatches = 16;

struct PresetCase {
  std::string preset, scene;
};

std::vector<PresetCase> cases() {
  std::vector<PresetCase> out{{"hslt", "mirror-glossy"}};
  if (!long_form()) return out;
  for (const std::string preset : {"mlt", "memlt", "hslt"})
    for (const std::string scene : {"mirror-glossy", "caustic", "sds", "fog-glass"})
      if (preset != "hslt" || scene != "mirror-glossy") out.push_back({preset, scene});
  return out;
}

class MltPresets : public testing::TestWithParam<PresetCase> {};

TEST_P(MltPresets, AgreeWithBdpt) {
  const auto& [preset, name] = GetParam();
  TestScene scene = scene_from_transport(name, kExtent, kExtent);
  use_own_filter(scene);
  std::uint64_t seed = 0;
  for (const char c : preset + name) seed = seed * 31 + static_cast<unsigned char>(c);
  seed %= 1u << 20;
  BatchPlan plan;
  plan.seed = 2 * seed << 32;
  plan.iterations = 32;
  const Estimator right =
      cached(make_estimator("bdpt", {{1.0, with_integrator(scene, "bdpt", {})}}, plan, kRegions));
  ChainJob job;
  job.scene = with_integrator(scene, "mlt",
                              {{"preset", preset},
                               {"chains", "64"},
                               {"bootstrap", "8192"},
                               {"mutations", "8"},
                               {"direct_samples", "4"},
                               {"large_step", "0.1"}});
  job.rounds = long_form() ? 64 : 2;
  const Estimator tested = make_chain_estimator("mlt", job, (2 * seed + 1) << 32, kBatches, kRegions);
  BlockTest test;
  test.decide = 0.1;
  const Verdict verdict = compare(tested, right, kRegions, test);
  std::printf("%s\n", verdict.report.c_str());
  EXPECT_TRUE(verdict.agree) << verdict.report;
  EXPECT_GT(verdict.tested * 2, verdict.values) << verdict.report;
}

std::string case_name(const testing::TestParamInfo<PresetCase>& one) {
  std::string name = one.param.preset + "_" + one.param.scene;
  for (char& c : name)
    if (c == '-') c = '_';
  return name;
}
INSTANTIATE_TEST_SUITE_P(, MltPresets, testing::ValuesIn(cases()), case_name);

}  // namespace
}  // namespace candela::statistical
