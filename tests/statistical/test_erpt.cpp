// Energy redistribution against bdpt, which knows nothing of chains and nothing of paths as states. Both have
// units that are iterations, so batches are independent and the test is that of block_tests.h: each pair
// alarms falsely with probability at most 1e-5, all with at most 1e-3.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "tests/proofs/proofs.h"
#include "tests/statistical/harness.h"
#include "tests/statistical/transport_scenes.h"

namespace candela::statistical {
namespace {

// Films decide these tests: proofs.h.
const proofs::FilmsDecide kFilms({"Erpt", "ErptSettings"});

constexpr std::uint32_t kExtent = 32;
const Regions kRegions(kExtent, kExtent, 8);

void expect_agreement(const std::string& what, std::string_view name, const SettingsMap& more,
                      std::uint64_t seed, const SettingsMap& of_both = {}) {
  SCOPED_TRACE(what);
  TestScene scene = scene_from_transport(name, kExtent, kExtent);
  use_own_filter(scene);
  BatchPlan plan;
  plan.seed = (2 * seed) << 32;
  plan.iterations = 32;
  const Estimator right =
      cached(make_estimator("bdpt", {{1.0, with_integrator(scene, "bdpt", of_both)}}, plan, kRegions));
  SettingsMap settings = of_both;
  settings["bootstrap"] = "4000";
  for (const auto& [setting, value] : more) settings[setting] = value;
  plan.seed = (2 * seed + 1) << 32;
  plan.iterations = long_form() ? 128 : 8;
  const Estimator tested =
      make_estimator("erpt", {{1.0, with_integrator(scene, "erpt", settings)}}, plan, kRegions);
  BlockTest test;
  test.decide = 0.1;
  const Verdict verdict = compare(tested, right, kRegions, test);
  std::printf("%s\n%s\n", what.c_str(), verdict.report.c_str());
  EXPECT_TRUE(verdict.agree) << verdict.report;
  EXPECT_GT(verdict.tested * 2, verdict.values) << verdict.report;
}

const SettingsMap kManifold{{"preset", "mept"}};

class Erpt : public testing::TestWithParam<std::string> {};

// Claim: erpt has the expectation of bdpt, with its own mutations and with those of manifolds.
TEST_P(Erpt, AgreesWithBdpt) {
  const auto entry = std::find_if(kTransportScenes.begin(), kTransportScenes.end(),
                                  [](const TransportScene& one) { return one.name == GetParam(); });
  ASSERT_NE(entry, kTransportScenes.end());
  const auto number = static_cast<std::uint64_t>(entry - kTransportScenes.begin());
  expect_agreement(GetParam(), GetParam(), {}, 4600 + number);
  if (long_form() || GetParam() == "sds")
    expect_agreement(GetParam() + ", manifold", GetParam(), kManifold, 4700 + number);
}

std::vector<std::string> scenes() {
  if (!long_form()) return {"box-diffuse", "thin-null", "sds", "orthographic", "envmap", "fog-null"};
  std::vector<std::string> names;
  for (const TransportScene& scene : kTransportScenes)
    if ((scene.complete & kBdpt) != 0 && scene.name != "smoke") names.emplace_back(scene.name);
  return names;
}
std::string scene_name(const testing::TestParamInfo<std::string>& one) {
  std::string name = one.param;
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
}
INSTANTIATE_TEST_SUITE_P(, Erpt, testing::ValuesIn(scenes()), scene_name);

// Claim: neither the energy and length of chains nor what is left to path tracing changes a mean.
TEST(ErptSettings, Agree) {
  expect_agreement("published energy, one mutation", "lens",
                   {{"chains_per_seed", "1"}, {"chain_length", "1"}}, 4800);
  expect_agreement("single scattering", "fog-thin", {{"direct", "chain"}}, 4806);
  expect_agreement(
      "direct=chain, many chains", "lens",
      {{"direct", "chain"}, {"chains_per_seed", "10"}, {"max_chains", "5"}, {"chain_length", "2"}}, 4801);
  if (!long_form()) return;
  expect_agreement("few long chains", "lens", {{"chains_per_seed", "0.01"}, {"chain_length", "100"}}, 4802);
  expect_agreement("all mutations", "lens", {{"bidirectional", "1"}, {"manifold", "1"}, {"half_vector", "1"}},
                   4803);
  expect_agreement("seeds=0.1, direct_samples=3", "lens", {{"seeds", "0.1"}, {"direct_samples", "3"}}, 4804);
  expect_agreement("max_depth=3", "lens", {}, 4805, {{"max_depth", "3"}});
}

}  // namespace
}  // namespace candela::statistical
