// Each mutation of mlt, and all together, against bdpt, which knows nothing of paths as states. Independent
// samples reach what a mutation alone does not.
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
const proofs::FilmsDecide kFilms({"MltMutations"});

constexpr std::uint32_t kExtent = 32;
const Regions kRegions(kExtent, kExtent, 8);
constexpr std::size_t kBatches = 16;

struct MutationCase {
  std::string name;
  std::vector<std::string> mutations;
  std::vector<std::string> scenes;
};

std::vector<MutationCase> cases() {
  const std::vector<std::string> all{"lens", "caustic", "multichain", "manifold", "half_vector"};
  std::vector<MutationCase> out{{"all", all, {"sds"}}};
  if (!long_form()) return out;
  out.push_back({"all_elsewhere", all, {"thin-null", "lens", "orthographic"}});
  for (const std::string& mutation : all)
    out.push_back({mutation, {"bidirectional", mutation}, {"sds", "caustic", "immersed"}});
  return out;
}

class MltMutations : public testing::TestWithParam<MutationCase> {};

TEST_P(MltMutations, AgreeWithBdpt) {
  SettingsMap settings{{"chains", "64"},        {"bootstrap", "8192"}, {"mutations", "8"},
                       {"direct_samples", "4"}, {"large_step", "0.1"}, {"bidirectional", "0"}};
  for (const std::string& mutation : GetParam().mutations)
    settings[mutation] = mutation == "bidirectional" ? "0.5" : "1";
  std::uint64_t seed = 0;
  for (const char c : GetParam().name) seed = seed * 31 + static_cast<unsigned char>(c);
  seed %= 1u << 20;
  for (const std::string& name : GetParam().scenes) {
    SCOPED_TRACE(name);
    TestScene scene = scene_from_transport(name, kExtent, kExtent);
    use_own_filter(scene);
    BatchPlan plan;
    plan.seed = 2 * ++seed << 32;
    plan.iterations = 32;
    const Estimator right =
        cached(make_estimator("bdpt", {{1.0, with_integrator(scene, "bdpt", {})}}, plan, kRegions));
    ChainJob job;
    job.scene = with_integrator(scene, "mlt", settings);
    job.rounds = long_form() ? 64 : 2;
    const Estimator tested = make_chain_estimator("mlt", job, (2 * seed + 1) << 32, kBatches, kRegions);
    BlockTest test;
    test.decide = 0.1;
    const Verdict verdict = compare(tested, right, kRegions, test);
    std::printf("%s\n", verdict.report.c_str());
    EXPECT_TRUE(verdict.agree) << verdict.report;
    EXPECT_GT(verdict.tested * 2, verdict.values) << verdict.report;
  }
}

std::string case_name(const testing::TestParamInfo<MutationCase>& one) {
  return one.param.name;
}
INSTANTIATE_TEST_SUITE_P(, MltMutations, testing::ValuesIn(cases()), case_name);

}  // namespace
}  // namespace candela::statistical
