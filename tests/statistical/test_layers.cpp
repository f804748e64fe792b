// Layers by light path expressions of integrators whose image is made of two estimators: erpt, of path
// tracing and short chains, and optimis, of several techniques at the first vertex. Seeds are fixed: nothing
// here is left to chance.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "tests/epoch_run.h"
#include "tests/statistical/harness.h"
#include "tests/statistical/layered_room.h"

namespace candela::statistical {
namespace {

const std::string kFog =
    R"(<shape type="sphere" id="puff"><point name="center" x="0.2" y="0" z="0.6"/><float name="radius" value="0.3"/>
      <bsdf type="null"/>
      <medium name="interior" type="homogeneous" id="fog"><rgb name="sigma_t" value="1, 2, 5"/></medium></shape>)";
const std::string kVeil =
    R"(<shape type="rectangle" id="veil"><transform name="to_world"><scale value="0.5"/><translate x="-0.6" z="0.6"/></transform>
      <bsdf type="mask"><float name="opacity" value="0.5"/><bsdf type="twosided"><bsdf type="diffuse"/></bsdf></bsdf></shape>)";

// Sums of the film's layers, of both halves.
std::vector<std::int64_t> sums_of(const TestScene& scene, std::uint64_t iterations, unsigned threads = 1) {
  const auto renderer = make_renderer(scene);
  const auto pilot = renderer->pilot({});
  if (!pilot.ok()) throw std::runtime_error(pilot.error().to_string());
  render::RunContext run;
  run.threads = threads;
  const auto job = test::render_job(*renderer, *pilot, iterations, run);
  if (!job.ok()) throw std::runtime_error(job.error().to_string());
  std::vector<std::int64_t> all = job->halves[0].sums;
  for (std::size_t i = 0; i < all.size(); ++i) all[i] += job->halves[1].sums[i];
  return all;
}

const Layers kByLastLetter = {{"seen", "LE"},
                              {"diffuse", "L[DGSV]*DE"},
                              {"glossy", "L[DGSV]*GE"},
                              {"specular", "L[DGSV]*SE"},
                              {"volume", "L[DGSV]*VE"}};

// Claim: with layers that are a partition the image is what it is without them, and is their sum, all to the
// last bit of the film, whatever the threads.
void expect_sum(const std::string& integrator, const SettingsMap& settings, const std::string& more = "") {
  constexpr std::uint64_t iterations = 6;
  const auto plain = sums_of(layered_room(integrator, settings, {}, false, more), iterations);
  const TestScene layered = layered_room(integrator, settings, kByLastLetter, true, more);
  const auto all = sums_of(layered, iterations);
  EXPECT_TRUE(all == sums_of(layered, iterations, 3)) << "threads leave a trace";
  ASSERT_EQ(plain.size(), kRoomValues);
  ASSERT_EQ(all.size(), kRoomValues * (1 + kByLastLetter.size()));
  ASSERT_TRUE(std::equal(plain.begin(), plain.end(), all.begin()));
  std::vector<std::size_t> lit(kByLastLetter.size());
  for (std::size_t i = 0; i < kRoomValues; ++i) {
    std::int64_t sum = 0;
    for (std::size_t e = 0; e < kByLastLetter.size(); ++e) {
      const std::int64_t value = all[(1 + e) * kRoomValues + i];
      sum += value;
      lit[e] += value != 0 ? 1 : 0;
    }
    ASSERT_EQ(sum, all[i]) << "value " << i;
  }
  for (std::size_t e = 0; e < 4; ++e) EXPECT_GT(lit[e], 20u) << kByLastLetter[e].name;
  EXPECT_EQ(lit[4] > 20, more == kFog);
}

TEST(LayersBeside, ErptAddUpToTheImage) {
  expect_sum("erpt", {{"direct_samples", "2"}});
  expect_sum("erpt", {{"direct", "chain"}, {"seeds", "0.5"}});
}
TEST(LayersBeside, OptimisAddUpToTheImage) {
  expect_sum("optimis", {});
  expect_sum("optimis", {{"weights", "maximum"}, {"light_groups", "each"}}, kVeil);
  expect_sum("optimis", {{"selection", "trained"}, {"epoch_min", "2"}}, kFog);
}

// Shares of the first layer's light.
std::vector<double> shares_of(const TestScene& scene, std::uint64_t iterations, std::size_t layers) {
  const auto sums = sums_of(scene, iterations);
  std::vector<double> light(layers);
  for (std::size_t e = 0; e < layers; ++e)
    for (std::size_t i = 0; i < kRoomValues; ++i)
      light[e] += static_cast<double>(sums[(1 + e) * kRoomValues + i]);
  for (std::size_t e = layers; e-- > 0;) light[e] /= light[0];
  return light;
}

// Claim: a layer has the light of the paths that its expression matches: by lamp, length, lobe, object.
void expect_shares(const std::string& integrator, const SettingsMap& settings, std::uint64_t iterations,
                   const std::string& reference, std::uint64_t reference_iterations) {
  const Layers layers = {{"all", "L[DGSV]*E"},         {"bulb", "L{bulb}[DGSV]*E"}, {"sky", "L{sky}[DGSV]*E"},
                         {"direct", "L[DGSV]E"},       {"diffuse", "L[DGSV]*DE"},   {"lobe", "LG{floor}E"},
                         {"later", "L[DGSV][DGSV]+E"}, {"ball", "L[DGSV]*G{ball}E"}};
  const auto expected = shares_of(layered_room(reference, {}, layers), reference_iterations, layers.size()),
             found = shares_of(layered_room(integrator, settings, layers), iterations, layers.size());
  for (std::size_t e = 1; e < layers.size(); ++e) {
    EXPECT_NEAR(found[e], expected[e], 0.1 * expected[e]) << layers[e].name;
    EXPECT_GT(expected[e], 0.02) << layers[e].name;
  }
}

TEST(LayersBeside, ErptHasTheSharesOfPath) {
  expect_shares("erpt", {}, 256, "path", 256);
}
TEST(LayersBeside, OptimisHasTheSharesOfPath) {
  expect_shares("optimis", {}, 192, "path", 256);
}

// Claim: optimal weights make the image beside the film: with layers the balance heuristic's image takes
// their place, and a job that names them is refused.
TEST(LayersBeside, OptimalWeightsGiveWay) {
  const auto plan_of = [](const SettingsMap& settings) -> Result<std::string> {
    const TestScene scene = layered_room("optimis", settings, kByLastLetter);
    CANDELA_ASSIGN(const auto renderer,
                   render::Renderer::create(*scene.files, scene.main_key, {}, scene.settings, 1));
    CANDELA_ASSIGN(const auto pilot, renderer->pilot({}));
    return pilot.plan;
  };
  const auto plan = plan_of({});
  ASSERT_TRUE(plan.ok()) << plan.error().to_string();
  EXPECT_NE(plan->find("layers by expression are parts of the film"), std::string::npos) << *plan;
  for (const auto& [name, value] : {std::pair{"weights", "optimal"}, {"estimator", "direct"}}) {
    const auto refused = plan_of({{name, value}});
    ASSERT_FALSE(refused.ok()) << name;
    EXPECT_EQ(refused.error().field, name);
    EXPECT_NE(refused.error().to_string().find(value), std::string::npos);
  }
}

}  // namespace
}  // namespace candela::statistical
