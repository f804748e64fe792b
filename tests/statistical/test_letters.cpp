// Layers by light path expressions, in every integrator that has them: they add up to the image to the last
// bit, and each is the light of its paths. Tests of the second kind compare with other scenes, in which those
// paths are all that is left: with one lamp, with short paths, without a lobe. Each comparison alarms falsely
// with probability at most 1e-5 (block_tests.h); there are fewer than 70 of them: the file alarms falsely
// with probability below 6e-4.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <utility>
#include <vector>

#include "common/letters/request.h"
#include "tests/epoch_run.h"
#include "tests/integrators.h"
#include "tests/proofs/proofs.h"
#include "tests/statistical/chain_driver.h"
#include "tests/statistical/harness.h"
#include "tests/unit/volume_file.h"

namespace candela::statistical {
namespace {

// Films decide these tests: proofs.h.
const proofs::FilmsDecide kFilms({"LayersOf", "EditedLayersOf"});

// Two lamps and a sky; glass, a rough conductor, a mask, and a floor of two lobes of different colors.
std::string scene_text(const std::string& lamps, const std::string& floor) {
  return R"(<scene version="3.0.0"><integrator type="volpath"><integer name="max_depth" value="6"/></integrator>
    <sensor type="perspective"><float name="fov" value="45"/>
      <transform name="to_world"><lookat origin="0, 4, 9" target="0, 1, 0" up="0, 1, 0"/></transform></sensor>
    <shape type="rectangle" id="floor"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="8"/></transform>)" +
         floor + R"(</shape>
    <shape type="sphere" id="ball"><point name="center" x="1.2" y="1" z="0.5"/><bsdf type="dielectric" id="glass"/></shape>
    <shape type="cube" id="box"><transform name="to_world"><translate x="-1.5" y="1"/></transform>
      <bsdf type="roughconductor"><float name="alpha" value="0.2"/></bsdf></shape>
    <shape type="rectangle" id="veil"><transform name="to_world"><translate x="-3" y="1" z="2"/></transform>
      <bsdf type="mask"><float name="opacity" value="0.5"/><bsdf type="twosided"><bsdf type="diffuse"/></bsdf></bsdf></shape>)" +
         lamps + "</scene>";
}

const std::string kCeiling =
    R"(<shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/><translate y="5"/></transform>
      <emitter type="area" id="ceiling"><rgb name="radiance" value="9, 8, 7"/></emitter></shape>)";
const std::string kSpot =
    R"(<emitter type="point" id="bulb"><point name="position" x="-3" y="4" z="4"/><rgb name="intensity" value="20, 30, 60"/></emitter>)";
const std::string kSky =
    R"(<emitter type="constant" id="sky"><rgb name="radiance" value="0.3, 0.4, 0.5"/></emitter>)";

const std::string kTwoLobes =
    R"(<bsdf type="twosided"><bsdf type="roughplastic"><float name="alpha" value="0.2"/>
      <rgb name="diffuse_reflectance" value="0.7, 0.3, 0.05"/><rgb name="specular_reflectance" value="0.1, 0.5, 1"/></bsdf></bsdf>)";
const std::string kOneLobe =
    R"(<bsdf type="twosided"><bsdf type="roughplastic"><float name="alpha" value="0.2"/>
      <rgb name="diffuse_reflectance" value="0.7, 0.3, 0.05"/><rgb name="specular_reflectance" value="0, 0, 0"/></bsdf></bsdf>)";

TestScene scene_of(const std::string& lamps, const std::string& floor, std::uint32_t width,
                   std::uint32_t height) {
  return scene_from_xml(scene_text(lamps, floor), width, height);
}

// By the last letter before the lens, and for paths of one edge.
const std::vector<letters::NamedExpression> kByLastLetter = {{"seen", "LE"},
                                                             {"diffuse", "L[DGSV]*DE"},
                                                             {"glossy", "L[DGSV]*GE"},
                                                             {"specular", "L[DGSV]*SE"},
                                                             {"volume", "L[DGSV]*VE"}};

std::string text_of(std::vector<letters::NamedExpression> layers, bool partition = false) {
  letters::LayerRequest request;
  request.layers = std::move(layers);
  request.partition = partition;
  return letters::text_of(request);
}

// Fog in the ball and the box, so that paths have letters V.
TestScene with_fog(TestScene scene) {
  std::string text = scene_text(kCeiling + kSky, kTwoLobes);
  const std::string fog =
      R"(<medium name="interior" type="homogeneous" id="fog"><rgb name="sigma_t" value="1, 2, 5"/></medium></shape>)";
  const std::string glass = R"(<bsdf type="dielectric" id="glass"/></shape>)";
  text.replace(text.find(glass), glass.size(), R"(<bsdf type="dielectric" id="glass"/>)" + fog);
  scene.files = std::make_shared<MemorySource>(std::map<std::string, std::string>{{"scene.xml", text}});
  return scene;
}

SettingsMap small_job(const std::string& integrator) {
  const auto& small = test::integrator_row(integrator).small;
  return {small.begin(), small.end()};
}

// Sums of all layers of a job of a few iterations, by half; of chains all that there are.
std::vector<std::vector<std::int64_t>> sums_of(const TestScene& scene, unsigned threads) {
  if (test::integrator_row(scene.settings.integrator).chains)
    return {render_chains({scene, 2, threads}, scene.settings.seed).sums};
  const auto renderer = make_renderer(scene);
  const auto pilot = renderer->pilot({});
  if (!pilot.ok()) throw std::runtime_error(pilot.error().to_string());
  render::RunContext run;
  run.threads = threads;
  const auto job = test::render_job(*renderer, *pilot, 6, run);
  if (!job.ok()) throw std::runtime_error(job.error().to_string());
  return {job->halves[0].sums, job->halves[1].sums};
}

// Claim: with layers that are a partition the image is what it is without them, and is their sum, all to the
// last bit of the film, whatever the threads; and more than one of the layers has light.
void layers_add_up(TestScene scene) {
  scene.settings.seed = 3;
  const auto plain = sums_of(scene, 1);
  scene.settings.layers = text_of(kByLastLetter, true);
  const auto layered = sums_of(scene, 1);
  EXPECT_TRUE(layered == sums_of(scene, 3)) << "threads leave a trace";
  const std::size_t values = std::size_t{scene.settings.width} * scene.settings.height * 3;
  const bool chains = test::integrator_row(scene.settings.integrator).chains;
  ASSERT_EQ(plain.size(), layered.size());
  std::size_t lit = 0;
  for (std::size_t half = 0; half < plain.size(); ++half) {
    const auto& own = plain[half];
    const auto& all = layered[half];
    const std::size_t parts = own.size() / values, expressions = kByLastLetter.size();
    ASSERT_EQ(all.size(), values * (parts + (chains ? 2 : 1) * expressions));
    ASSERT_TRUE(std::equal(own.begin(), own.end(), all.begin()));
    for (std::size_t part = 0; part < (chains ? 2 : 1); ++part) {
      for (std::size_t i = 0; i < values; ++i) {
        std::int64_t sum = 0;
        for (std::size_t e = 0; e < expressions; ++e)
          sum += all[(parts + part * expressions + e) * values + i];
        ASSERT_EQ(sum, all[part * values + i]) << "value " << i << " of part " << part;
      }
    }
    for (std::size_t e = 0; e < expressions; ++e) {
      const auto begin = all.begin() + static_cast<std::ptrdiff_t>((parts + e) * values);
      lit += std::any_of(begin, begin + static_cast<std::ptrdiff_t>(values), [](auto v) { return v != 0; });
    }
  }
  EXPECT_GE(lit, 2 * plain.size());
}

class Layers : public testing::TestWithParam<std::string> {};

TEST_P(Layers, AddUpToTheImage) {
  const TestScene scene = scene_of(kCeiling + kSpot + kSky, kTwoLobes, 37, 23);
  layers_add_up(with_integrator(scene, GetParam(), small_job(GetParam())));
}

TEST_P(Layers, AddUpToTheImageInFog) {
  const TestScene scene = with_fog(scene_of(kCeiling + kSky, kTwoLobes, 37, 23));
  layers_add_up(with_integrator(scene, GetParam(), small_job(GetParam())));
}

// Edits that select by more of the path than the vertex: walks carry weights of states, some of which are 0
// at the floor, whose letter is drawn by the lobes' shares all the same.
const std::string kEditsByPath = R"({"edits": [
    {"name": "a", "direction": "light", "select": "LX*X{floor}X{NAME}", "rotate": {"axis": [0.2, 1, 0.3], "degrees": 25},
     "tint": [1, 0.3, 0.6]},
    {"name": "b", "direction": "eye", "select": "X{NAME}X{floor}X*E", "rotate": {"axis": [1, 0.2, 0], "degrees": 20}}]})";
std::string edits_at(const std::string& name) {
  std::string text = kEditsByPath;
  for (auto at = text.find("NAME"); at != std::string::npos; at = text.find("NAME"))
    text.replace(at, 4, name);
  return text;
}

class EditedLayers : public testing::TestWithParam<std::string> {};

TEST_P(EditedLayers, AddUpToTheImage) {
  TestScene scene = scene_of(kCeiling + kSpot + kSky, kTwoLobes, 29, 17);
  scene.settings.edits = edits_at("box");
  layers_add_up(with_integrator(scene, GetParam(), small_job(GetParam())));
}
INSTANTIATE_TEST_SUITE_P(, EditedLayers,
                         testing::Values("path", "light", "bdpt", "ppm", "bpm", "vcm", "pssmlt", "mmlt"),
                         [](const auto& one) { return one.param; });

std::vector<std::string> layered_integrators() {
  std::vector<std::string> names;
  for (const test::IntegratorRow& row : test::integrators())
    if (row.name != "optimis" && row.everything) names.push_back(row.name);
  return names;
}
INSTANTIATE_TEST_SUITE_P(, Layers, testing::ValuesIn(layered_integrators()),
                         [](const auto& one) { return one.param; });

// A room of two lamps: closed, so that light paths stay. A ball of rough metal, a floor of two lobes.
const std::string kPanel =
    R"(<shape type="rectangle"><transform name="to_world"><scale value="0.4"/><rotate x="1" angle="90"/><translate y="1.9"/></transform>
      <emitter type="area" id="panel"><rgb name="radiance" value="5, 4, 3"/></emitter></shape>)";
// The same surface without its light.
const std::string kDarkPanel =
    R"(<shape type="rectangle"><transform name="to_world"><scale value="0.4"/><rotate x="1" angle="90"/><translate y="1.9"/></transform>
      <bsdf type="diffuse"><rgb name="reflectance" value="0, 0, 0"/></bsdf></shape>)";
const std::string kBulb =
    R"(<emitter type="point" id="bulb"><point name="position" x="-0.6" y="0.8" z="0.5"/><rgb name="intensity" value="0.3, 0.5, 0.9"/></emitter>)";
std::string room_text(const std::string& lamps, const std::string& floor) {
  return R"(<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="5"/></integrator>
    <sensor type="perspective"><float name="fov" value="60"/>
      <transform name="to_world"><lookat origin="0, 1.2, 0.9" target="0, -0.5, -0.1" up="0, 1, 0"/></transform></sensor>
    <shape type="cube" id="walls"><transform name="to_world"><scale x="1" y="2" z="1"/></transform>
      <bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="0.5, 0.6, 0.4"/></bsdf></bsdf></shape>
    <shape type="rectangle" id="floor"><transform name="to_world"><rotate x="1" angle="-90"/><translate y="-0.5"/></transform>)" +
         floor + R"(</shape>
    <shape type="sphere" id="ball"><point name="center" x="0.35" y="-0.1" z="-0.3"/><float name="radius" value="0.3"/>
      <bsdf type="roughconductor" id="metal"><float name="alpha" value="0.25"/></bsdf></shape>)" +
         lamps + "</scene>";
}

// A layer against a scene whose image has nothing else, or whose same layer has.
struct Case {
  std::string name;
  letters::NamedExpression layer;
  std::string lamps, floor;  // of the other scene
  SettingsMap settings;      // of the other scene
  bool both = false;         // the other scene has the layer, too, and is compared by it
};
const std::vector<Case>& cases() {
  static const std::vector<Case> all = {
      {"panel", {"a", "L{panel}[DGSV]*E"}, kPanel, kTwoLobes, {}},
      {"bulb", {"a", "L{bulb}X*E"}, kDarkPanel + kBulb, kTwoLobes, {}},
      {"short", {"a", "LE|LXE"}, kPanel + kBulb, kTwoLobes, {{"max_depth", "2"}}},
      {"lobe", {"a", "L D{floor} E"}, kPanel + kBulb, kOneLobe, {{"max_depth", "2"}}, true},
  };
  return all;
}

void expect_the_light_of_its_paths(const std::string& integrator, const BlockTest& test = {},
                                   const SettingsMap& settings = {}) {
  constexpr std::uint32_t kWidth = 24, kHeight = 16;
  const Regions regions(kWidth, kHeight, 8);
  const auto scene_of = [&](const std::string& lamps, const std::string& floor) {
    return scene_from_xml(room_text(lamps, floor), kWidth, kHeight);
  };
  for (const Case& c : cases()) {
    TestScene whole = with_integrator(scene_of(kPanel + kBulb, kTwoLobes), integrator, settings);
    whole.settings.layers = text_of({c.layer});
    TestScene other = with_integrator(scene_of(c.lamps, c.floor), "bdpt", c.settings);
    if (c.both) other.settings.layers = text_of({c.layer});
    BatchPlan plan{.seed = 11, .batches = 12, .iterations = 16, .layer = c.both ? 1u : 0u};
    const Estimator reference = make_estimator("bdpt of " + c.name, {{1, other}}, plan, regions);
    plan.seed = 12;
    plan.layer = 1;
    const Estimator tested = make_estimator(integrator + " " + c.name, {{1, whole}}, plan, regions);
    const Verdict verdict = compare(tested, reference, regions, test);
    EXPECT_TRUE(verdict.agree) << verdict.report;
    EXPECT_GT(verdict.tested, regions.values() / 2) << verdict.report;
    EXPECT_LT(verdict.detectable_whole, 0.45) << verdict.report;
  }
}

// Claim: a layer has the light of the paths that its expression matches: by lamps, by length, and by a lobe
// of a bsdf that has two, of different colors.
TEST(LayersOf, PathAreTheLightOfTheirPaths) {
  expect_the_light_of_its_paths("path");
}
TEST(LayersOf, BdptAreTheLightOfTheirPaths) {
  expect_the_light_of_its_paths("bdpt");
}
TEST(LayersOf, VcmAreTheLightOfTheirPaths) {
  expect_the_light_of_its_paths("vcm", {.margin = 0.03}, {{"radius", "0.05"}});
}
TEST(LayersOf, BpmAreTheLightOfTheirPaths) {
  expect_the_light_of_its_paths("bpm", {.margin = 0.08}, {{"radius", "0.03"}});
}
TEST(LayersOf, PpmAreTheLightOfTheirPaths) {
  expect_the_light_of_its_paths("ppm", {.margin = 0.08}, {{"radius", "0.03"}});
}

// Claim: beside edits that select by more of the path than the vertex, too, a layer is the same light from
// both ends, told by the letter of a surface of two lobes next to the edited one.
TEST(EditedLayersOf, AllAreTheLightOfTheirPaths) {
  constexpr std::uint32_t kWidth = 24, kHeight = 16;
  const Regions regions(kWidth, kHeight, 8);
  std::vector<std::string> expressions = {"L[DGSV]*D{floor}X{ball}E"};
  if (long_form()) expressions.emplace_back("L[DGSV]*X{ball}D{floor}E");
  for (const std::string& expression : expressions) {
    const auto layer_by = [&](const std::string& integrator, const SettingsMap& settings,
                              std::uint64_t seed) {
      TestScene scene = with_integrator(scene_from_xml(room_text(kPanel + kBulb, kTwoLobes), kWidth, kHeight),
                                        integrator, settings);
      scene.settings.edits = edits_at("ball");
      scene.settings.layers = text_of({{"a", expression}});
      return make_estimator(integrator, {{1, scene}},
                            {.seed = seed, .batches = 12, .iterations = 64, .layer = 1}, regions);
    };
    const Estimator reference = cached(layer_by("bdpt", {}, 21));
    for (const auto& [integrator, margin] :
         {std::pair{"path", 0.0}, std::pair{"light", 0.0}, std::pair{"vcm", 0.03}}) {
      const bool light = integrator == std::string("light");
      if (light && !long_form()) continue;
      const SettingsMap settings = margin > 0 ? SettingsMap{{"radius", "0.05"}} : SettingsMap{};
      const Verdict verdict =
          compare(layer_by(integrator, settings, 22), reference, regions, {.margin = margin});
      EXPECT_TRUE(verdict.agree) << verdict.report;
      EXPECT_LT(verdict.detectable_whole, light ? 1.2 : 0.6) << verdict.report;
    }
  }
}

}  // namespace
}  // namespace candela::statistical
