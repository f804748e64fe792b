// Layers by light path expressions of integrators whose image is made of two estimators: erpt, of path
// tracing and short chains, and optimis, of several techniques at the first vertex. Seeds are fixed: nothing
// here is left to chance.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "common/letters/request.h"
#include "tests/epoch_run.h"
#include "tests/integrators.h"
#include "tests/statistical/harness.h"

namespace candela::statistical {
namespace {

using Layers = std::vector<letters::NamedExpression>;

constexpr std::uint32_t kWidth = 24, kHeight = 16;
constexpr std::size_t kValues = std::size_t{kWidth} * kHeight * 3;

const std::string kFog =
    R"(<shape type="sphere" id="puff"><point name="center" x="0.2" y="0" z="0.6"/><float name="radius" value="0.3"/>
      <bsdf type="null"/>
      <medium name="interior" type="homogeneous" id="fog"><rgb name="sigma_t" value="1, 2, 5"/></medium></shape>)";
const std::string kVeil =
    R"(<shape type="rectangle" id="veil"><transform name="to_world"><scale value="0.5"/><translate x="-0.6" z="0.6"/></transform>
      <bsdf type="mask"><float name="opacity" value="0.5"/><bsdf type="twosided"><bsdf type="diffuse"/></bsdf></bsdf></shape>)";

// Two lamps and two skies over a ball of rough metal, glass, and a floor of two lobes of different colors.
TestScene room(const std::string& integrator, const SettingsMap& settings, const Layers& layers,
               bool partition = false, const std::string& more = "") {
  TestScene scene = scene_from_xml(
      R"(<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="5"/></integrator>
    <sensor type="perspective"><float name="fov" value="60"/>
      <transform name="to_world"><lookat origin="0, 1.2, 2" target="0, -0.3, -0.1" up="0, 1, 0"/></transform></sensor>
    <shape type="rectangle" id="floor"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="3"/><translate y="-0.5"/></transform>
      <bsdf type="twosided"><bsdf type="roughplastic"><float name="alpha" value="0.2"/>
      <rgb name="diffuse_reflectance" value="0.7, 0.3, 0.05"/><rgb name="specular_reflectance" value="0.1, 0.5, 1"/></bsdf></bsdf></shape>
    <shape type="sphere" id="ball"><point name="center" x="0.5" y="0" z="-0.3"/><float name="radius" value="0.45"/>
      <bsdf type="roughconductor"><float name="alpha" value="0.25"/></bsdf></shape>
    <shape type="sphere" id="glass"><point name="center" x="-0.6" y="0" z="0"/><float name="radius" value="0.4"/>
      <bsdf type="dielectric"/></shape>
    <shape type="rectangle"><transform name="to_world"><scale value="0.6"/><rotate x="1" angle="90"/><translate y="1.9"/></transform>
      <emitter type="area" id="panel"><rgb name="radiance" value="5, 4, 3"/></emitter></shape>
    <emitter type="point" id="bulb"><point name="position" x="-0.6" y="0.8" z="0.5"/><rgb name="intensity" value="3, 5, 9"/></emitter>
    <emitter type="constant" id="sky"><rgb name="radiance" value="0.3, 0.4, 0.5"/></emitter>)" +
          more + "</scene>",
      kWidth, kHeight);
  const auto& small = test::integrator_row(integrator).small;
  SettingsMap all(small.begin(), small.end());
  for (const auto& [name, value] : settings) all[name] = value;
  scene = with_integrator(scene, integrator, all);
  letters::LayerRequest request;
  request.layers = layers;
  request.partition = partition;
  if (!layers.empty()) scene.settings.layers = letters::text_of(request);
  scene.settings.seed = 5;
  return scene;
}

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
  const auto plain = sums_of(room(integrator, settings, {}, false, more), iterations);
  const TestScene layered = room(integrator, settings, kByLastLetter, true, more);
  const auto all = sums_of(layered, iterations);
  EXPECT_TRUE(all == sums_of(layered, iterations, 3)) << "threads leave a trace";
  ASSERT_EQ(plain.size(), kValues);
  ASSERT_EQ(all.size(), kValues * (1 + kByLastLetter.size()));
  ASSERT_TRUE(std::equal(plain.begin(), plain.end(), all.begin()));
  std::vector<std::size_t> lit(kByLastLetter.size());
  for (std::size_t i = 0; i < kValues; ++i) {
    std::int64_t sum = 0;
    for (std::size_t e = 0; e < kByLastLetter.size(); ++e) {
      const std::int64_t value = all[(1 + e) * kValues + i];
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
    for (std::size_t i = 0; i < kValues; ++i) light[e] += static_cast<double>(sums[(1 + e) * kValues + i]);
  for (std::size_t e = layers; e-- > 0;) light[e] /= light[0];
  return light;
}

// Claim: a layer has the light of the paths that its expression matches: by lamp, length, lobe, object.
void expect_shares(const std::string& integrator, const SettingsMap& settings, std::uint64_t iterations,
                   const std::string& reference, std::uint64_t reference_iterations) {
  const Layers layers = {{"all", "L[DGSV]*E"},         {"bulb", "L{bulb}[DGSV]*E"}, {"sky", "L{sky}[DGSV]*E"},
                         {"direct", "L[DGSV]E"},       {"diffuse", "L[DGSV]*DE"},   {"lobe", "LG{floor}E"},
                         {"later", "L[DGSV][DGSV]+E"}, {"ball", "L[DGSV]*G{ball}E"}};
  const auto expected = shares_of(room(reference, {}, layers), reference_iterations, layers.size()),
             found = shares_of(room(integrator, settings, layers), iterations, layers.size());
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
    const TestScene scene = room("optimis", settings, kByLastLetter);
    CANDELA_ASSIGN(const auto renderer,
                   render::Renderer::create(*scene.files, scene.main_key, {}, scene.settings, 1));
    CANDELA_ASSIGN(const auto pilot, renderer->pilot({}));
    return pilot.plan;
  };
  const auto plan = plan_of({});
  ASSERT_TRUE(plan.ok()) << plan.error().to_string();
  EXPECT_NE(plan->find("layers by expression are parts of the film"), std::string::npos) << *plan;
  for (const auto& [name, value] :
       {std::pair{"weights", "optimal"}, {"weights", "best"}, {"estimator", "progressive"}}) {
    const auto refused = plan_of({{name, value}});
    ASSERT_FALSE(refused.ok()) << name;
    EXPECT_EQ(refused.error().field, name);
    EXPECT_NE(refused.error().to_string().find(value), std::string::npos);
  }
}

}  // namespace
}  // namespace candela::statistical
