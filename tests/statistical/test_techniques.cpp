// The techniques of bdpt by themselves: heuristics that weigh them, and the film's layers, one a technique.
// Block tests (block_tests.h) alarm falsely with probability at most 1e-5 each; there are fewer than 100: the
// whole file with at most 1e-3.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <stdexcept>

#include "tests/proofs/proofs.h"
#include "tests/statistical/harness.h"

namespace candela::statistical {
namespace {

// Films decide these tests: proofs.h.
const proofs::FilmsDecide kFilms({"Heuristics", "Layers"});

constexpr std::uint32_t kExtent = 64;
const Regions kRegions(kExtent, kExtent, 16);

TestScene load(const std::string& name) {
  TestScene scene = scene_from_transport(name, kExtent, kExtent);
  use_own_filter(scene);
  return scene;
}

BatchPlan batches(std::uint64_t seed, std::uint64_t iterations = 2) {
  BatchPlan plan;
  plan.seed = seed << 32;
  plan.iterations = iterations * (long_form() ? 16 : 1);
  return plan;
}

void expect_agreement(const Estimator& tested, const Estimator& reference) {
  BlockTest test;
  test.decide = 0.1;
  const Verdict verdict = compare(tested, reference, kRegions, test);
  std::printf("%s\n", verdict.report.c_str());
  EXPECT_TRUE(verdict.agree);
  EXPECT_GT(verdict.tested * 2, verdict.values) << verdict.report;
}

class Heuristics : public testing::TestWithParam<const char*> {};

// Claim: balance, power, maximum and cutoff have one expectation, that of `path`.
TEST_P(Heuristics, AgreeInExpectation) {
  const TestScene scene = load(GetParam());
  const Estimator right = cached(make_estimator("path", {{1.0, scene}}, batches(1), kRegions));
  std::uint64_t seed = 2;
  for (const char* heuristic : {"balance", "power", "maximum", "cutoff"}) {
    SCOPED_TRACE(heuristic);
    const TestScene weighed = with_integrator(scene, "bdpt", {{"heuristic", heuristic}});
    expect_agreement(
        make_estimator(fmt::format("bdpt {}", heuristic), {{1.0, weighed}}, batches(seed++), kRegions),
        right);
  }
}

INSTANTIATE_TEST_SUITE_P(, Heuristics, testing::Values("box-diffuse", "lens", "fog-thin", "rough-glass"),
                         [](const auto& one) {
                           std::string name = one.param;
                           std::replace(name.begin(), name.end(), '-', '_');
                           return name;
                         });

// All layers of the same renders: sums of layers as estimators. Batches are shared, so that two of these are
// independent only if made from different instances.
class Layered {
 public:
  Layered(const TestScene& scene, const BatchPlan& plan) : scene_(scene), plan_(plan) {
    const auto pilot = make_renderer(scene)->pilot({});
    if (!pilot.ok()) throw std::runtime_error(pilot.error().to_string());
    names_ = pilot->work.layers;
  }
  const std::vector<std::string>& names() const { return names_; }
  std::size_t find(const std::string& name) const {
    const auto found = std::find(names_.begin(), names_.end(), name);
    if (found == names_.end()) throw std::runtime_error("no layer " + name);
    return static_cast<std::size_t>(found - names_.begin()) + 1;
  }
  Estimator sum(const std::string& name, std::vector<std::size_t> layers) {
    return {name, [this, layers](std::uint64_t stage, double effort) {
              Rows rows;
              for (const auto& film : films(stage, effort)) {
                std::vector<double> total(film[0].size(), 0.0);
                for (const std::size_t layer : layers)
                  for (std::size_t i = 0; i < total.size(); ++i) total[i] += film[layer][i];
                rows.push_back(kRegions.means(total));
              }
              return rows;
            }};
  }
  // [batch][layer][value]
  using Films = std::vector<std::vector<std::vector<double>>>;
  const Films& films(std::uint64_t stage, double effort) {
    Films& films = memory_[{stage, effort}];
    if (films.empty()) {
      const NamedState state = pilot_state(scene_);
      const auto iterations =
          static_cast<std::uint64_t>(std::ceil(static_cast<double>(plan_.iterations) * effort));
      for (std::size_t batch = 0; batch < plan_.batches; ++batch)
        films.push_back(render_layers(scene_, state, plan_.seed + (stage << 20) + batch,
                                      static_cast<std::uint32_t>(batch % 2), 0, iterations, plan_.threads));
    }
    return films;
  }

 private:
  TestScene scene_;
  BatchPlan plan_;
  std::vector<std::string> names_;
  std::map<std::pair<std::uint64_t, double>, Films> memory_;
};

class Layers : public testing::TestWithParam<const char*> {
 protected:
  // Depth of the longest paths with layers of their own.
  static constexpr int kDepth = 3;
  static TestScene with_layers(const TestScene& scene) {
    return with_integrator(scene, "bdpt",
                           {{"layers", "both"}, {"layer_depth", std::to_string(kDepth)}, {"plan", "full"}});
  }
};

// Claim: the weighted layers of all techniques sum to the image, to the rounding of the film.
TEST_P(Layers, WeightedSumToTheImage) {
  BatchPlan plan = batches(1, 4);
  plan.batches = 1;
  Layered layered(with_layers(load(GetParam())), plan);
  std::size_t count = 0;
  const auto& film = layered.films(1, 1)[0];
  std::vector<double> sum(film[0].size(), 0.0);
  for (std::size_t layer = 0; layer < layered.names().size(); ++layer) {
    if (layered.names()[layer].rfind("weighted", 0) != 0) continue;
    ++count;
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += film[layer + 1][i];
  }
  EXPECT_EQ(count, 1U + 3 + 4 + 1);  // of one, two and three edges, and of more
  double mean = 0, worst = 0;
  for (const double value : film[0]) mean += value / static_cast<double>(film[0].size());
  for (std::size_t i = 0; i < sum.size(); ++i) worst = std::max(worst, std::fabs(sum[i] - film[0][i]));
  std::printf("%s: %zu layers, mean %.4g, largest difference of a pixel %.2g of it\n", GetParam(), count,
              mean, worst / mean);
  // Each of some tens of contributions is rounded by at most 2^-19 of the mean or so, without bias.
  EXPECT_LT(worst, 1e-5 * mean);
}

// Claim: where every technique can make every path of a depth, each unweighted layer alone is the light of
// that depth, and so is the sum of the weighted ones.
TEST_P(Layers, UnweightedAgree) {
  if (GetParam() != std::string("box-diffuse") && !long_form()) GTEST_SKIP() << "only with CANDELA_LONG=1";
  const TestScene scene = with_layers(load(GetParam()));
  Layered all(scene, batches(3, 8)), other(scene, batches(4, 8));
  for (int depth = 2; depth <= kDepth; ++depth) {
    const Estimator right =
        other.sum(fmt::format("depth {}: s1", depth), {other.find(fmt::format("unweighted.s1.t{}", depth))});
    std::vector<std::size_t> weighted;
    for (int s = 0; s <= depth; ++s) {
      weighted.push_back(all.find(fmt::format("weighted.s{}.t{}", s, depth + 1 - s)));
      if (s == 1) continue;
      SCOPED_TRACE(fmt::format("depth {}, s {}", depth, s));
      expect_agreement(
          all.sum(fmt::format("s{}", s), {all.find(fmt::format("unweighted.s{}.t{}", s, depth + 1 - s))}),
          right);
    }
    SCOPED_TRACE(fmt::format("depth {}, weighted", depth));
    expect_agreement(all.sum("weighted", weighted), right);
  }
}

// All matt, with lamps of some size: no technique is shut out.
INSTANTIATE_TEST_SUITE_P(, Layers, testing::Values("box-diffuse", "textured-lamp"), [](const auto& one) {
  std::string name = one.param;
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
});

}  // namespace
}  // namespace candela::statistical
