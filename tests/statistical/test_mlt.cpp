// Metropolis light transport in path space against bdpt, which knows nothing of chains and nothing of the
// literal formulas that mlt is made of.
//
// As in test_markov.cpp a batch is a job of its own, so batches are independent, and the block tests hold
// with their own variance: each alarms falsely with probability at most 1e-5, all with at most 1e-3.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "tests/proofs/proofs.h"
#include "tests/statistical/chain_driver.h"
#include "tests/statistical/transport_scenes.h"

namespace candela::statistical {
namespace {

// Films decide these tests: proofs.h.
const proofs::FilmsDecide kFilms({"Mlt", "MltSettings"});

constexpr std::uint32_t kExtent = 32;
const Regions kRegions(kExtent, kExtent, 8);
constexpr std::size_t kBatches = 16;

TestScene load(std::string_view name) {
  TestScene scene = scene_from_transport(name, kExtent, kExtent);
  use_own_filter(scene);
  return scene;
}

// Few chains and mutations: a batch is small, and there are many.
ChainJob job_of(const TestScene& scene, const SettingsMap& more = {}) {
  SettingsMap settings{{"chains", "64"}, {"bootstrap", "8192"}, {"mutations", "8"}, {"direct_samples", "4"}};
  for (const auto& [name, value] : more) settings[name] = value;
  ChainJob job;
  job.scene = with_integrator(scene, "mlt", settings);
  job.rounds = long_form() ? 64 : 2;
  return job;
}

void expect_agreement(const std::string& what, const TestScene& scene, const SettingsMap& more,
                      std::uint64_t seed, const SettingsMap& of_both = {}) {
  SCOPED_TRACE(what);
  BatchPlan plan;
  plan.seed = seed << 32;
  plan.iterations = 32;
  const Estimator right =
      cached(make_estimator("bdpt", {{1.0, with_integrator(scene, "bdpt", of_both)}}, plan, kRegions));
  SettingsMap settings = of_both;
  for (const auto& [name, value] : more) settings[name] = value;
  const Estimator tested =
      make_chain_estimator("mlt", job_of(scene, settings), (seed + 1) << 32, kBatches, kRegions);
  BlockTest test;
  test.decide = 0.1;
  const Verdict verdict = compare(tested, right, kRegions, test);
  std::printf("%s\n", verdict.report.c_str());
  EXPECT_TRUE(verdict.agree) << verdict.report;
  EXPECT_GT(verdict.tested * 2, verdict.values) << verdict.report;
}

class Mlt : public testing::TestWithParam<std::string> {};

// Claim: mlt has the expectation of bdpt.
TEST_P(Mlt, AgreesWithBdpt) {
  const auto entry = std::find_if(kTransportScenes.begin(), kTransportScenes.end(),
                                  [](const TransportScene& one) { return one.name == GetParam(); });
  ASSERT_NE(entry, kTransportScenes.end());
  const auto number = static_cast<std::uint64_t>(entry - kTransportScenes.begin());
  expect_agreement(GetParam(), load(entry->name), {}, 1 + 2 * number);
}

std::vector<std::string> scenes() {
  if (!long_form()) return {"box-diffuse", "thin-null", "orthographic", "envmap", "fog-null"};
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
INSTANTIATE_TEST_SUITE_P(, Mlt, testing::ValuesIn(scenes()), scene_name);

// Claim: what is left to path tracing, and how often a chain starts anew, change no mean.
TEST(MltSettings, Agree) {
  const TestScene lens = load("lens");
  expect_agreement("direct=chain", lens, {{"direct", "chain"}}, 201);
  expect_agreement("single scattering", load("fog-thin"), {{"direct", "chain"}}, 211);
  expect_agreement("large_step=0", lens, {{"large_step", "0"}, {"chains", "512"}}, 205);
  expect_agreement("two_stage=false", lens, {{"two_stage", "false"}}, 209);
  if (!long_form()) return;
  expect_agreement("large_step=1", lens, {{"large_step", "1"}}, 203);
  expect_agreement("max_depth=3", lens, {}, 207, {{"max_depth", "3"}});
}

// Claim: threads change no bit, on surfaces and in media; states are small.
TEST(MltJobs, ThreadsChangeNothing) {
  for (const char* scene : {"lens", "fog-glass"}) {
    SCOPED_TRACE(scene);
    ChainJob job = job_of(load(scene), {{"chains", "8"}, {"bootstrap", "1000"}, {"mutations", "2"}});
    job.rounds = 3;
    const ChainImage one = render_chains(job, 7);
    job.threads = 3;
    const ChainImage three = render_chains(job, 7);
    EXPECT_EQ(one.sums, three.sums);
    EXPECT_EQ(one.records, three.records);
    EXPECT_GT(one.b.b, 0);
    for (const chains::ChainRecord& record : one.records) {
      EXPECT_LT(record.state.size(), 1024u);
      EXPECT_GT(record.counts.accepted, 0u);
    }
  }
}

// Claim: what mlt does not render it refuses, with what does.
TEST(MltJobs, GridsAreRefused) {
  for (const std::string integrator : {"mlt", "erpt"}) {
    const TestScene smoke = with_integrator(scene_from_transport("smoke", 8, 8), integrator, {});
    const auto renderer = render::Renderer::create(*smoke.files, smoke.main_key, {}, smoke.settings, 1);
    ASSERT_FALSE(renderer.ok());
    EXPECT_EQ(renderer.error().kind, ErrorKind::usage);
    EXPECT_NE(renderer.error().to_string().find("grids"), std::string::npos);
  }
}

}  // namespace
}  // namespace candela::statistical
