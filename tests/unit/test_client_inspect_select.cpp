// Tests of `candela inspect falsecolor` of a scene, and of its --select.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "common/base/files.h"
#include "tests/unit/client_outcome.h"

namespace candela::client {
namespace {

using nlohmann::json;

// A matt floor and a mirror under a lamp.
constexpr const char* kRoom =
    R"(<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="4"/></integrator>
      <sensor type="perspective"><float name="fov" value="40"/><transform name="to_world">
      <lookat origin="0, 3, 6" target="0, 0, 0" up="0, 1, 0"/></transform>
      <sampler type="independent"><integer name="sample_count" value="4"/></sampler>
      <film type="hdrfilm"><integer name="width" value="24"/><integer name="height" value="16"/></film></sensor>
      <shape type="rectangle" id="floor"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="4"/></transform>
      <bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf></shape>
      <shape type="sphere" id="ball"><float name="radius" value="0.7"/><bsdf type="conductor"/></shape>
      <emitter type="constant" id="sky"><rgb name="radiance" value="0.5, 1, 2"/></emitter></scene>)";

class FalseColorSelects : public CommandTest {
 protected:
  void SetUp() override {
    CommandTest::SetUp();
    std::ofstream(scene_) << kRoom;
  }
  std::string in_folder(const std::string& name) const { return (folder_.path() / name).string(); }
  Outcome show(std::vector<std::string> words) const {
    words.insert(words.begin(), {"inspect", "falsecolor"});
    words.insert(words.end(), {"-o", png_});
    return run_candela(words);
  }
  // The figures of the JSON, and the PNG's bytes.
  std::pair<json, std::string> shown(std::vector<std::string> words) const {
    words.emplace_back("--json");
    const Outcome done = show(words);
    EXPECT_EQ(done.code, 0) << done.err;
    const auto png = read_file(png_, 1u << 24);
    EXPECT_TRUE(png.ok());
    return {done.code == 0 ? json::parse(done.out) : json(), png.ok() ? *png : ""};
  }

  const std::string scene_ = in_folder("room.xml"), png_ = in_folder("out.png");
};

// Claim: of a scene is shown what `render` makes of it, with its options: the image, the layer of an
// expression in any integrator, the error, an AOV, the irradiance. An EXR shows the layer of an expression
// that reads the same. The light of expressions that are a partition adds up to the image's.
TEST_F(FalseColorSelects, WhatIsRendered) {
  for (const std::string integrator : {"path", "bdpt", "pssmlt"}) {
    const std::vector<std::string> options = {"--integrator", integrator, "--spp",  "6",    "--quiet",
                                              "--seed",       "3",        "--size", "20x12"};
    const std::string exr = in_folder(integrator + ".exr");
    std::vector<std::string> words = {"render", scene_, "-o", exr, "--error-layer", "--aov", "depth,albedo"};
    words.insert(words.end(),
                 {"--layer", "in_ball=L[GDSV]* S{ball}E", "--layer", "others=L([DGSV]*[DGV])?E"});
    words.insert(words.end(), options.begin(), options.end());
    const Outcome rendered = run_candela(words);
    ASSERT_EQ(rendered.code, 0) << rendered.err;
    double sum = 0, image = 0;
    for (const auto& choice : {std::vector<std::string>{},
                               {"--select", "L[DGSV]*S{ball}E"},
                               {"--select", "L([DGSV]*[VDG])?E"},
                               {"--layer", "error"},
                               {"--layer", "depth"},
                               {"--layer", "irradiance", "--channel", "luminance"},
                               {"--channel", "B", "--select", "L[VDGS]* (S{ball}) E"}}) {
      std::vector<std::string> of_scene = {scene_}, of_image = {exr};
      of_scene.insert(of_scene.end(), options.begin(), options.end());
      for (auto* const of : {&of_scene, &of_image}) of->insert(of->end(), choice.begin(), choice.end());
      const auto [figures, png] = shown(of_scene);
      const auto [expected_figures, expected_png] = shown(of_image);
      const std::string what = testing::PrintToString(choice);
      EXPECT_EQ(figures, expected_figures) << what;
      EXPECT_TRUE(png == expected_png) << what;
      if (choice.empty()) image = figures.at("mean");
      if (!choice.empty() && choice[0] == "--select") {
        EXPECT_EQ(figures.at("quantity"), choice[1] + ", luminance");
        EXPECT_GT(figures.at("mean"), 0);
        sum += figures.at("mean").get<double>();
      }
    }
    EXPECT_NEAR(sum, image, 1e-5 * image);
  }
  // Nothing but the output stays.
  for (const auto& entry : std::filesystem::directory_iterator(folder_.path()))
    EXPECT_TRUE(entry.path().extension() != ".candela") << entry.path();
}

// Claim: without a limit of its own a scene is rendered as it says.
TEST_F(FalseColorSelects, TheScenesOwnSamples) {
  const std::string exr = in_folder("a.exr");
  ASSERT_EQ(run_candela({"render", scene_, "-o", exr, "--quiet"}).code, 0);
  EXPECT_EQ(shown({scene_, "--quiet"}), shown({exr}));
}

// Claim: a difference is of the same expression of both.
TEST_F(FalseColorSelects, Differences) {
  const std::string exr = in_folder("a.exr");
  ASSERT_EQ(run_candela({"render", scene_, "-o", exr, "--quiet", "--layer", "ball=L[DGSV]*SE"}).code, 0);
  const auto [figures, png] =
      shown({scene_, "--quiet", "--select", "L[DGSV]*SE", "--minus", exr, "--signed", "--range", "-1,1"});
  EXPECT_EQ(figures.at("quantity"), "L[DGSV]*SE, luminance, difference");
  EXPECT_EQ(figures.at("minimum"), 0);
  EXPECT_EQ(figures.at("maximum"), 0);
  EXPECT_EQ(show({exr, "--minus", exr, "--select", "LSE"}).code, 2);
}

// Claim: what cannot be selected is one error with the option and a mend, and no PNG; an expression's errors
// have the column. No light at all is no error.
TEST_F(FalseColorSelects, RefusesWhatCannotBeSelected) {
  const std::string exr = in_folder("a.exr"), plain = in_folder("plain.exr"),
                    groups = in_folder("groups.exr");
  const auto render = [&](const std::string& to, std::vector<std::string> more) {
    more.insert(more.begin(), {"render", scene_, "-o", to, "--quiet", "--spp", "1"});
    ASSERT_EQ(run_candela(more).code, 0);
  };
  render(exr, {"--layer", "direct=L[XV]E", "--layer", "seen=LE"});
  render(plain, {});
  render(groups, {"--light-groups"});
  const struct {
    std::vector<std::string> arguments;
    std::string part;
  } cases[] = {
      {{exr, "--select", "L[DE"}, "--select: column 2: this '[' is not closed"},
      {{scene_, "--select", "L[DE"}, "--select: column 2: this '[' is not closed"},
      {{exr, "--select", ""}, "--select: the expression is empty"},
      {{scene_, "--select", "LE", "--layer", "error"}, "--layer and --select exclude each other"},
      {{scene_, "--select", "LX{flor}E"}, "--select: layer 'select', column 2: no surface"},
      {{scene_, "--select", "LX@there E"}, "--select: layer 'select', column 2: there is no region 'there'"},
      {{scene_, "--region", "there=box:0,0,0,1,1,1"}, "--region: a region is named for --select"},
      {{exr, "--select", "LDE"},
       "a.exr: --select: the image has no layer of the expression 'LDE' (there is direct=L[XV]E, seen=LE; "
       "give "
       "the scene in place of the image, or render with --layer NAME=EXPR)"},
      {{plain, "--select", "LDE"}, "'LDE' (give the scene in place of the image"},
      {{groups, "--select", "LDE"}, "'LDE' (there is light groups; give the scene"},
      {{exr, "--spp", "4"}, "--spp: "},
      {{exr, "--spp", "4"}, "is no scene, and is not rendered (leave it out, or give a scene)"},
      {{exr, "--glossy-below", "0.2", "--select", "LE"}, "--glossy-below: "},
      {{in_folder("none.exr"), "--select", "LE"}, "none.exr: "},
      {{in_folder("none.xml")}, "none.xml"},
      {{scene_, "--layer", "nothing", "--spp", "1", "--quiet"}, "room.xml: the image has no layer 'nothing'"},
  };
  for (const auto& c : cases) {
    const Outcome r = show(c.arguments);
    const std::string said = testing::PrintToString(c.arguments) + "\n" + r.err;
    EXPECT_EQ(r.code, 2) << said;
    EXPECT_EQ(r.out, "") << said;
    EXPECT_NE(r.err.find(c.part), std::string::npos) << said;
    EXPECT_EQ(r.err.find('\n'), r.err.size() - 1) << said;
    EXPECT_FALSE(std::filesystem::exists(png_)) << said;
  }
  const auto [figures, png] = shown({scene_, "--select", "L{sky}SSE", "--spp", "1", "--quiet"});
  EXPECT_EQ(figures.at("maximum"), 0);
}

}  // namespace
}  // namespace candela::client
