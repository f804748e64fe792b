// Layers by light path expressions of mlt, whose states are whole paths. Seeds are fixed: nothing here is
// left to chance.
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "common/letters/request.h"
#include "tests/epoch_run.h"
#include "tests/integrators.h"
#include "tests/statistical/chain_driver.h"
#include "tests/statistical/harness.h"

namespace candela::statistical {
namespace {

using Layers = std::vector<letters::NamedExpression>;

constexpr std::uint32_t kWidth = 24, kHeight = 16;
constexpr std::size_t kValues = std::size_t{kWidth} * kHeight * 3;

// Two lamps and a sky over a ball of rough metal, glass, and a floor of two lobes of different colors.
TestScene room(const std::string& integrator, const Layers& layers, bool partition,
               const SettingsMap& more = {}) {
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
    <emitter type="constant" id="sky"><rgb name="radiance" value="0.3, 0.4, 0.5"/></emitter></scene>)",
      kWidth, kHeight);
  const auto& small = test::integrator_row(integrator).small;
  SettingsMap settings(small.begin(), small.end());
  for (const auto& [key, value] : more) settings[key] = value;
  scene = with_integrator(scene, integrator, settings);
  letters::LayerRequest request;
  request.layers = layers;
  request.partition = partition;
  if (!layers.empty()) scene.settings.layers = letters::text_of(request);
  scene.settings.seed = 5;
  return scene;
}

std::vector<std::int64_t> sums_of_chains(const TestScene& scene, std::uint64_t rounds, unsigned threads) {
  return render_chains({scene, rounds, threads}, scene.settings.seed).sums;
}

std::vector<std::int64_t> sums_of_bdpt(const TestScene& scene) {
  const auto renderer = make_renderer(scene);
  const auto pilot = renderer->pilot({});
  if (!pilot.ok()) throw std::runtime_error(pilot.error().to_string());
  const auto job = test::render_job(*renderer, *pilot, 64, {});
  if (!job.ok()) throw std::runtime_error(job.error().to_string());
  return job->halves[0].sums;
}

// Claim: with layers that are a partition the image is what it is without them, and is their sum, all to the
// last bit of the film, whatever the threads.
TEST(MltLayers, AddUpToTheImage) {
  const Layers layers = {{"seen", "LE"},
                         {"diffuse", "L[DGSV]*DE"},
                         {"glossy", "L[DGSV]*GE"},
                         {"specular", "L[DGSV]*SE"},
                         {"volume", "L[DGSV]*VE"}};
  const auto plain = sums_of_chains(room("mlt", {}, false), 8, 1);
  const auto all = sums_of_chains(room("mlt", layers, true), 8, 1);
  EXPECT_TRUE(all == sums_of_chains(room("mlt", layers, true), 8, 3)) << "threads leave a trace";
  // The chains' part and that of independent samples, then the layers of each.
  ASSERT_EQ(plain.size(), 2 * kValues);
  ASSERT_EQ(all.size(), kValues * 2 * (1 + layers.size()));
  ASSERT_TRUE(std::equal(plain.begin(), plain.end(), all.begin()));
  std::size_t lit = 0;
  for (std::size_t part = 0; part < 2; ++part)
    for (std::size_t i = 0; i < kValues; ++i) {
      std::int64_t sum = 0;
      for (std::size_t e = 0; e < layers.size(); ++e) {
        const std::int64_t value = all[(2 + part * layers.size() + e) * kValues + i];
        sum += value;
        lit += part == 0 && value != 0;
      }
      ASSERT_EQ(sum, all[part * kValues + i]) << "value " << i << " of part " << part;
    }
  EXPECT_GT(lit, 100u);
}

// Claim: whole paths have the labels that walks give them: each layer's share of the light is that of bdpt,
// by lamp, by lobe, and by object.
TEST(MltLayers, HaveTheSharesOfBdpt) {
  // Chains have paths of two scattering vertices and more.
  const Layers layers = {{"all", "L[DGSV][DGSV]+E"},      {"bulb", "L{bulb}[DGSV][DGSV]+E"},
                         {"sky", "L{sky}[DGSV][DGSV]+E"}, {"diffuse", "L[DGSV]+DE"},
                         {"lobe", "LD{floor}[DGSV]+E"},   {"ball", "L[DGSV]+G{ball}E"}};
  const auto shares = [&](const std::vector<std::int64_t>& sums, std::size_t first) {
    std::vector<double> light(layers.size());
    for (std::size_t e = 0; e < layers.size(); ++e)
      for (std::size_t i = 0; i < kValues; ++i)
        light[e] += static_cast<double>(sums[(first + e) * kValues + i]);
    for (std::size_t e = layers.size(); e-- > 0;) light[e] /= light[0];
    return light;
  };
  // The sums are those of chains alone, which leave to large steps what these find, most where the importance
  // of the film is low.
  const SettingsMap few_large = {{"large_step", "0.001"}};
  const auto expected = shares(sums_of_bdpt(room("bdpt", layers, false)), 1),
             found = shares(sums_of_chains(room("mlt", layers, false, few_large), 3200, 1), 2);
  for (std::size_t e = 1; e < layers.size(); ++e) {
    EXPECT_NEAR(found[e], expected[e], 0.05) << layers[e].name;
    EXPECT_GT(expected[e], 0.08) << layers[e].name;
    EXPECT_LT(expected[e], 0.92) << layers[e].name;
  }
}

}  // namespace
}  // namespace candela::statistical
