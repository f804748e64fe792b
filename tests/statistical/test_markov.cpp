// Integrators of Markov chains against path and bdpt, which know nothing of chains.
//
// Samples of a chain are correlated, so a batch is a job of its own: bootstrap, chains, normalisation, with a
// seed of its own. Batches are independent, and the block tests (block_tests.h) hold with the batches' own
// variance; each alarms falsely with probability at most 1e-5. There are fewer than 200: all with at most
// 2e-3.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "tests/proofs/proofs.h"
#include "tests/statistical/chain_driver.h"
#include "tests/statistical/transport_scenes.h"

namespace candela::statistical {
namespace {

// Films decide these tests: proofs.h.
const proofs::FilmsDecide kFilms({"Markov", "MarkovDirect", "MarkovDepths", "MarkovNormalisation"});

constexpr std::uint32_t kExtent = 64;
const Regions kRegions(kExtent, kExtent, 16);
constexpr std::size_t kBatches = 16;

TestScene load(std::string_view name, std::uint32_t extent = kExtent) {
  TestScene scene = scene_from_transport(name, extent, extent);
  use_own_filter(scene);
  return scene;
}

// Few chains and mutations: a batch is small, and there are many.
SettingsMap small_job(SettingsMap more = {}) {
  SettingsMap settings{{"chains", "64"}, {"bootstrap", "8192"}, {"mutations", "4"}, {"direct_samples", "1"}};
  for (auto& [name, value] : more) settings[name] = value;
  return settings;
}

struct Method {
  std::string name;
  std::string integrator;
  SettingsMap settings;
};
std::vector<Method> methods() {
  return {{"pssmlt over bdpt", "pssmlt", {{"over", "bdpt"}}},
          {"pssmlt over path", "pssmlt", {{"over", "path"}}},
          {"mmlt", "mmlt", {}}};
}

ChainJob job_of(const TestScene& scene, const Method& method, const SettingsMap& more = {}) {
  SettingsMap settings = small_job(method.settings);
  for (const auto& [name, value] : more) settings[name] = value;
  ChainJob job;
  job.scene = with_integrator(scene, method.integrator, settings);
  job.rounds = long_form() ? 64 : 4;
  return job;
}

Estimator reference(const TestScene& scene, const std::string& integrator, std::uint64_t seed,
                    const SettingsMap& settings = {}) {
  BatchPlan plan;
  plan.seed = seed << 32;
  plan.iterations = integrator == "path" ? 32 : 8;
  return cached(
      make_estimator(integrator, {{1.0, with_integrator(scene, integrator, settings)}}, plan, kRegions));
}

void expect_agreement(const Estimator& tested, const Estimator& right, bool only_brighter = false) {
  BlockTest test;
  test.decide = 0.1;
  test.only_brighter = only_brighter;
  const Verdict verdict = compare(tested, right, kRegions, test);
  std::printf("%s\n", verdict.report.c_str());
  EXPECT_TRUE(verdict.agree) << verdict.report;
  EXPECT_GT(verdict.tested * 2, verdict.values) << verdict.report;
}

class Markov : public testing::TestWithParam<std::string> {};

// Claim: pssmlt over bdpt, pssmlt over path and mmlt have the expectation of bdpt (where a scene has light
// that the estimator below cannot find, that estimator is left out).
TEST_P(Markov, AgreesWithBdpt) {
  const auto entry = std::find_if(kTransportScenes.begin(), kTransportScenes.end(),
                                  [](const TransportScene& one) { return one.name == GetParam(); });
  ASSERT_NE(entry, kTransportScenes.end());
  const TestScene scene = load(entry->name);
  const Estimator right = reference(scene, "bdpt", 1);
  std::uint64_t seed = 2;
  for (const Method& method : methods()) {
    const bool by_path = method.name == "pssmlt over path";
    if ((entry->complete & (by_path ? kPath : kBdpt)) == 0) continue;
    SCOPED_TRACE(method.name);
    expect_agreement(
        make_chain_estimator(method.name, job_of(scene, method), seed++ << 32, kBatches, kRegions), right,
        (entry->slow & (by_path ? kPath : kBdpt)) != 0);
  }
}

std::vector<std::string> scenes() {
  if (!long_form())
    return {"box-diffuse", "caustic", "sds",      "thin-null", "lens",
            "envmap",      "filter",  "fog-thin", "many-lamps"};
  std::vector<std::string> names;
  for (const TransportScene& scene : kTransportScenes)
    if ((scene.complete & kBdpt) != 0) names.emplace_back(scene.name);
  return names;
}
std::string scene_name(const testing::TestParamInfo<std::string>& one) {
  std::string name = one.param;
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
}
INSTANTIATE_TEST_SUITE_P(, Markov, testing::ValuesIn(scenes()), scene_name);

// Claim: direct=path changes no mean: what the chains leave out is what path tracing adds, with and without
// the emitters themselves.
TEST(MarkovDirect, ByPathAgrees) {
  for (const char* name : {"box-diffuse", "lens"}) {
    const TestScene scene = load(name);
    std::uint64_t seed = 20;
    for (const char* hidden : {"false", "true"}) {
      // The short form hides the emitters of one scene and shows those of the other.
      if (!long_form() && (hidden == std::string("true")) != (name == std::string("lens"))) continue;
      const Estimator right = reference(scene, "bdpt", seed++, {{"hide_emitters", hidden}});
      for (const Method& method : methods()) {
        SCOPED_TRACE(fmt::format("{} {} {}", name, method.name, hidden));
        expect_agreement(
            make_chain_estimator(method.name,
                                 job_of(scene, method, {{"direct", "path"}, {"hide_emitters", hidden}}),
                                 seed++ << 32, kBatches, kRegions),
            right);
      }
    }
  }
}

// Claim: max_depth cuts where bdpt's does.
TEST(MarkovDepths, Agree) {
  const TestScene scene = load("lens");
  std::uint64_t seed = 40;
  for (const char* depth : {"1", "2", "4"}) {
    const Estimator right = reference(scene, "path", seed++, {{"max_depth", depth}});
    for (const Method& method : methods()) {
      SCOPED_TRACE(fmt::format("{} {}", method.name, depth));
      expect_agreement(make_chain_estimator(method.name, job_of(scene, method, {{"max_depth", depth}}),
                                            seed++ << 32, kBatches, kRegions),
                       right);
    }
  }
}

// Claim: b0 is no more than a weight: were it wrong by a factor, the image would have the same mean, since
// only what depends on b is scaled by the pooled estimate of it.
TEST(MarkovNormalisation, AWrongFirstEstimateChangesNoMean) {
  const TestScene scene = load("caustic");
  const Estimator right = reference(scene, "bdpt", 60);
  std::uint64_t seed = 61;
  const std::vector<double> factors = {0.5, 2.0, 30.0};
  for (std::size_t i = 0; i < methods().size(); ++i) {
    const Method method = methods()[i];
    // The short form gives each method one factor: the weight by b0 is one piece of code for all methods.
    for (const double factor : long_form() ? factors : std::vector<double>{factors[i]}) {
      SCOPED_TRACE(fmt::format("{} {}", method.name, factor));
      ChainJob job = job_of(scene, method);
      job.b0_factor = factor;
      expect_agreement(make_chain_estimator(fmt::format("{}, b0 times {}", method.name, factor), job,
                                            seed++ << 32, kBatches, kRegions),
                       right, method.name == "pssmlt over path");
    }
  }
}

// Claim: no large steps and nothing but large steps have the same mean too.
TEST(MarkovNormalisation, AnyProbabilityOfLargeStepsAgrees) {
  const TestScene scene = load("box-diffuse");
  const Estimator right = reference(scene, "bdpt", 80);
  std::uint64_t seed = 81;
  const std::vector<std::string> shares = {"0", "0.05", "1"};
  for (std::size_t l = 0; l < shares.size(); ++l) {
    const std::string& large = shares[l];
    for (std::size_t i = 0; i < methods().size(); ++i) {
      // The short form leaves one share out for each method.
      if (!long_form() && i == l) continue;
      const Method method = methods()[i];
      SCOPED_TRACE(fmt::format("{} {}", method.name, large));
      // Without large steps chains forget their starts slowly: many chains.
      expect_agreement(make_chain_estimator(
                           method.name, job_of(scene, method, {{"large_step", large}, {"chains", "1024"}}),
                           seed++ << 32, kBatches, kRegions),
                       right);
    }
  }
}

}  // namespace
}  // namespace candela::statistical
