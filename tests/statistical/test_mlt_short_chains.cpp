// Stationarity of mlt: many chains that start with the density of the target, and stop after a few mutations.
// No large step hides what mutations do, and whatever moves away from the target shows at once [half-vector
// note, section 19, tests 5 and 6].
//
// As in test_mlt.cpp a batch is a job of its own; each test alarms falsely with probability at most 1e-5.
#include <gtest/gtest.h>

#include <cstdio>
#include <string>
#include <vector>

#include "tests/statistical/chain_driver.h"
#include "tests/statistical/transport_scenes.h"

namespace candela::statistical {
namespace {

constexpr std::uint32_t kExtent = 32;
const Regions kRegions(kExtent, kExtent, 8);
constexpr std::size_t kBatches = 16;

struct ShortCase {
  std::string name, scene;
  SettingsMap mutations;
};

std::vector<ShortCase> cases() {
  std::vector<ShortCase> out{{"mlt", "caustic", {{"preset", "mlt"}}}};
  if (!long_form()) return out;
  for (const std::string scene : {"mirror-glossy", "caustic", "sds", "box-diffuse"}) {
    for (const std::string preset : {"mlt", "memlt", "hslt"})
      out.push_back({preset + "_of", scene, {{"preset", preset}}});
    for (const std::string mutation : {"lens", "caustic", "multichain", "manifold", "half_vector"})
      out.push_back({mutation, scene, {{"bidirectional", "0.1"}, {mutation, "0.9"}}});
  }
  return out;
}

class MltShortChains : public testing::TestWithParam<ShortCase> {};

TEST_P(MltShortChains, AreAtTheTargetFromTheStart) {
  const ShortCase& one = GetParam();
  TestScene scene = scene_from_transport(one.scene, kExtent, kExtent);
  use_own_filter(scene);
  std::uint64_t seed = 0;
  for (const char c : one.name + one.scene) seed = seed * 31 + static_cast<unsigned char>(c);
  seed %= 1u << 20;
  BatchPlan plan;
  plan.seed = 2 * seed << 32;
  plan.iterations = 32;
  const Estimator right =
      cached(make_estimator("bdpt", {{1.0, with_integrator(scene, "bdpt", {})}}, plan, kRegions));
  // As many chains as pixels: a mutation a round, and eight of them.
  SettingsMap settings{{"chains", "1024"},
                       {"bootstrap", "16384"},
                       {"mutations", "1"},
                       {"large_step", "0"},
                       {"direct_samples", "1"}};
  for (const auto& [name, value] : one.mutations) settings[name] = value;
  ChainJob job;
  job.scene = with_integrator(scene, "mlt", settings);
  job.rounds = 8;
  const Estimator tested =
      make_chain_estimator("mlt", job, (2 * seed + 1) << 32, long_form() ? 8 * kBatches : kBatches, kRegions);
  BlockTest test;
  test.decide = 0.1;
  const Verdict verdict = compare(tested, right, kRegions, test);
  std::printf("%s\n", verdict.report.c_str());
  EXPECT_TRUE(verdict.agree) << verdict.report;
  EXPECT_GT(verdict.tested * 2, verdict.values) << verdict.report;
}

std::string case_name(const testing::TestParamInfo<ShortCase>& one) {
  std::string name = one.param.name + "_" + one.param.scene;
  for (char& c : name)
    if (c == '-') c = '_';
  return name;
}
INSTANTIATE_TEST_SUITE_P(, MltShortChains, testing::ValuesIn(cases()), case_name);

}  // namespace
}  // namespace candela::statistical
