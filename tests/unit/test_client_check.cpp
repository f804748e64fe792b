// candela check: exit codes, what it lists, and its JSON.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "client/embedded/app.h"
#include "common/image/image.h"
#include "tests/unit/client_outcome.h"

namespace candela::client {
namespace {

namespace fs = std::filesystem;

class Check : public testing::Test {
 protected:
  void SetUp() override { fs::create_directories(folder_); }
  void TearDown() override { fs::remove_all(folder_); }

  void write(const std::string& name, const std::string& content) const {
    std::ofstream(folder_ / name, std::ios::binary) << content;
  }

  // The scene's content, with a sensor and an integrator of its own.
  Outcome check(const std::string& content, std::vector<std::string> options = {},
                const std::string& integrator = "path", const std::string& version = "3.0.0") const {
    write("scene.xml", "<scene version='" + version + "'>\n<integrator type='" + integrator +
                           "'/>\n<sensor type='perspective'><film type='hdrfilm'><integer name='width' "
                           "value='32'/><integer name='height' value='16'/></film></sensor>\n" +
                           content + "\n</scene>\n");
    options.insert(options.begin(), {"candela", "check", (folder_ / "scene.xml").string()});
    std::ostringstream out, err;
    const int code = run_program(options, out, err);
    return {code, out.str(), err.str()};
  }

  const fs::path folder_ = fs::path(testing::TempDir()) / ("check-" + std::to_string(::getpid()));
};

constexpr const char* box = "<shape type='cube'/><emitter type='constant'/>";

// Claim: a good scene is code 0 and a list of what it is made of.
TEST_F(Check, ListsWhatTheSceneUses) {
  const Outcome outcome = check(box);
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  for (const char* part :
       {"shape: cube; 12 triangles\n", "emitter: constant\n", "film: hdrfilm; 32 x 16 pixels\n",
        "runs: path, ", "file: scene.xml: ", "0 warnings, 0 notes\n"})
    EXPECT_NE(outcome.out.find(part), std::string::npos) << part << " is not in\n" << outcome.out;
  EXPECT_EQ(outcome.err, "");
}

// Claim: light that the chosen integrator never finds is a note with the two ways out; not if another one, or
// regularise=on, is chosen.
TEST_F(Check, LightThatIsMissing) {
  const std::string scene =
      "<shape type='cube'/><shape type='sphere'><bsdf type='dielectric'/></shape><emitter type='point'/>";
  for (const char* integrator : {"path", "bdpt", "pssmlt", "mmlt", "mlt", "erpt"}) {
    const Outcome outcome = check(scene, {}, integrator);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_NE(outcome.out.find("note: "), std::string::npos) << outcome.out;
    EXPECT_NE(outcome.out.find("light that is missing: "), std::string::npos) << outcome.out;
    EXPECT_NE(outcome.out.find("take vcm"), std::string::npos) << outcome.out;
    EXPECT_NE(outcome.out.find("regularise=on"), std::string::npos) << outcome.out;
    std::vector<std::string> on = {"--set", "regularise=on"};
    if (integrator == std::string_view("mlt") || integrator == std::string_view("erpt"))
      on.insert(on.end(), {"--set", "direct=chain"});
    EXPECT_NE(check(scene, on, integrator).out.find("0 warnings, 0 notes\n"), std::string::npos)
        << integrator;
  }
  EXPECT_NE(check(scene, {}, "vcm").out.find("0 warnings, 0 notes\n"), std::string::npos);
  // Merging needs a matt surface: without one it finds no more than connections do.
  const std::string clear = "<shape type='sphere'><bsdf type='dielectric'/></shape><emitter type='point'/>";
  for (const char* integrator : {"ppm", "vcm", "mcppm"}) {
    EXPECT_NE(check(clear, {}, integrator).out.find("light that is missing: "), std::string::npos);
    EXPECT_NE(check(clear, {}, integrator).out.find("bdpt with regularise=on"), std::string::npos);
    EXPECT_EQ(check(clear, {"--set", "max_depth=1"}, integrator).out.find("missing"), std::string::npos);
  }
  // No false alarm: lamps that eye paths meet, rough glass, no glass, short paths.
  const std::string rough =
      "<shape type='cube'/><shape type='sphere'><bsdf type='roughdielectric'/></shape><emitter "
      "type='point'/>";
  const std::string area =
      "<shape type='cube'/><shape type='sphere'><bsdf type='dielectric'/></shape>"
      "<shape type='sphere'><emitter type='area'/></shape>";
  for (const char* integrator : {"path", "bdpt", "pssmlt", "mmlt", "mlt", "erpt"}) {
    for (const std::string& body : {rough, area, std::string("<shape type='cube'/><emitter type='point'/>")})
      EXPECT_EQ(check(body, {}, integrator).out.find("missing"), std::string::npos) << integrator << body;
    EXPECT_EQ(check(scene, {"--set", "max_depth=1"}, integrator).out.find("missing"), std::string::npos);
  }
}

// Claim: two bodies of glass that share a face are a warning that names both; with a gap, beside each other
// in one plane, or where one of them is matt, there is none. A medium counts like glass.
TEST_F(Check, SharedFaces) {
  const auto cube = [](const char* id, double x, const char* inside, double y = 0) {
    return "<shape type='cube' id='" + std::string(id) + "'><transform name='to_world'><translate x='" +
           std::to_string(x) + "' y='" + std::to_string(y) + "'/></transform>" + inside + "</shape>\n";
  };
  const char *glass = "<bsdf type='dielectric'/>", *matt = "<bsdf type='diffuse'/>",
             *fog = "<bsdf type='null'/><medium type='homogeneous' name='interior'/>";
  const std::string light = "<emitter type='constant'/>";
  const std::string text = "a face of this shape lies in one place with one of the shape at scene.xml:";
  const auto warns = [&](const std::string& first, const std::string& second) {
    const Outcome outcome = check(first + second + light);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return outcome.out.find(text) != std::string::npos;
  };
  const Outcome shared = check(cube("left", 0, glass) + cube("right", 2, glass) + light);
  EXPECT_NE(shared.out.find(text + "4 ('left')"), std::string::npos) << shared.out;
  EXPECT_EQ(check(cube("left", 0, glass) + cube("right", 2, glass) + light, {"--strict"}).code, 1);
  EXPECT_TRUE(warns(cube("a", 0, glass), cube("b", 2, fog)));
  EXPECT_TRUE(warns(cube("a", 0, glass), cube("b", 2, glass, 1.5)));  // a quarter of the face
  EXPECT_FALSE(warns(cube("a", 0, glass), cube("b", 2.001, glass)));
  EXPECT_FALSE(warns(cube("a", 0, glass), cube("b", 2, matt)));
  EXPECT_FALSE(warns(cube("a", 0, glass), cube("b", 2, glass, 2)));  // an edge
  EXPECT_FALSE(warns(cube("a", 0, glass), cube("b", 3, glass)));     // floors in one plane, side by side
  // Only a few of very many pairs are told.
  std::string many;
  for (int i = 0; i < 40; ++i) many += cube(("c" + std::to_string(i)).c_str(), 2 * i, glass);
  const std::string out = check(many + light).out;
  std::size_t told = 0;
  for (std::size_t at = out.find(text); at != out.npos; at = out.find(text, at + 1)) ++told;
  EXPECT_EQ(told, 8U);
}

// Claim: the JSON has the promised names, sizes of images, and bytes of files.
TEST_F(Check, JsonShape) {
  const std::vector<float> pixels(8 * 4 * 3, 0.5F);
  const auto exr = image::encode_exr(8, 4, pixels, {});
  ASSERT_TRUE(exr.ok());
  write("wood.exr", *exr);
  const Outcome outcome = check(
      std::string(box) +
          "<shape type='sphere'><bsdf type='diffuse'><texture type='bitmap' name='reflectance'>"
          "<string name='filename' value='wood.exr'/><boolean name='accel' value='true'/></texture></bsdf>"
          "</shape><bsdf type='diffuse' id='spare'/>",
      {"--json", "--strict"});
  EXPECT_EQ(outcome.code, 0) << outcome.err << outcome.out;
  const auto json = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(json.at("uses").at("shape").at("cube"), 1);
  EXPECT_EQ(json.at("uses").at("texture").at("bitmap"), 1);
  EXPECT_EQ(json.at("triangles"), 12);
  EXPECT_EQ(json.at("width"), 32);
  EXPECT_EQ(json.at("integrator"), "path");
  EXPECT_TRUE(json.at("integrator_settings").contains("max_depth"));
  ASSERT_EQ(json.at("images").size(), 1U);
  EXPECT_EQ(json.at("images")[0].at("path"), "wood.exr");
  EXPECT_EQ(json.at("images")[0].at("width"), 8);
  EXPECT_EQ(json.at("images")[0].at("height"), 4);
  EXPECT_EQ(json.at("images")[0].at("channels"), 3);
  EXPECT_EQ(json.at("images")[0].at("bits"), 32);
  EXPECT_EQ(json.at("images")[0].at("bytes"), exr->size());
  ASSERT_EQ(json.at("files").size(), 2U);
  EXPECT_EQ(json.at("warnings"), 0);
  ASSERT_EQ(json.at("findings").size(), 2U);
  EXPECT_EQ(json.at("findings")[0].at("kind"), "ignored");
  EXPECT_EQ(json.at("findings")[0].at("file"), "scene.xml");
  EXPECT_EQ(json.at("findings")[0].at("line"), 4);
  EXPECT_EQ(json.at("findings")[1].at("kind"), "unused");
}

// Claim: a difference from Mitsuba is a warning; it fails the command only where --strict asks for it.
TEST_F(Check, StrictFailsOnWarnings) {
  const std::string scene =
      "<shape type='cube'/><emitter type='constant'><spectrum name='radiance' value='500:1, "
      "510:1'/></emitter>";
  const Outcome lenient = check(scene);
  EXPECT_EQ(lenient.code, 0) << lenient.err;
  EXPECT_NE(lenient.out.find("warning: scene.xml:4: the spectrum is out of Rec.709's range"),
            std::string::npos)
      << lenient.out;
  EXPECT_NE(lenient.out.find("1 warning, 0 notes"), std::string::npos) << lenient.out;
  EXPECT_EQ(check(scene, {"--strict"}).code, 1);
}

// Claim: an integrator that Candela lacks does not hide what else there is to say; it is a warning.
TEST_F(Check, OtherIntegratorsAreWarnings) {
  const Outcome outcome = check(box, {}, "aov");
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("warning: scene.xml:2: there is no integrator 'aov' here"), std::string::npos)
      << outcome.out;
  EXPECT_NE(check(box, {"--integrator", "path"}, "aov").out.find("the command line for 'path'"),
            std::string::npos);
}

// Claim: a bad scene is code 2 and one line, whether the description or the building of it fails.
TEST_F(Check, BadScenesAreCodeTwo) {
  const Outcome unknown = check("<shape type='cubus'/>");
  EXPECT_EQ(unknown.code, 2);
  EXPECT_EQ(unknown.out, "");
  EXPECT_NE(unknown.err.find("unknown shape 'cubus' (did you mean 'cube'?)"), std::string::npos)
      << unknown.err;
  write("broken.obj", "v 0 0\nf 1 2 3\n");
  const Outcome broken = check(
      "<shape type='obj'><string name='filename' value='broken.obj'/></shape><emitter type='constant'/>");
  EXPECT_EQ(broken.code, 2);
  EXPECT_NE(broken.err.find("broken.obj"), std::string::npos) << broken.err;
}

// Claim: a scene that needs more memory than --scene-memory is code 2 and one line, which names the place,
// the limit and the option; a value that is no size is an error of the option.
TEST_F(Check, ScenesBeyondTheMemoryAreCodeTwo) {
  std::string many;
  for (int i = 0; i < 20'000; ++i) many += "<shape type='sphere'/>\n";
  const Outcome outcome = check(many, {"--scene-memory", "8M"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_EQ(outcome.out, "");
  EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
  EXPECT_NE(outcome.err.find((folder_ / "scene.xml").string() + ":"), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find("more memory than the 8 MiB"), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find("--scene-memory"), std::string::npos) << outcome.err;
  const Outcome bad = check(box, {"--scene-memory", "much"});
  EXPECT_EQ(bad.code, 2);
  EXPECT_NE(bad.err.find("--scene-memory: 'much' is not a size in bytes"), std::string::npos) << bad.err;
}

// Claim: all errors of a scene's text are listed, the file and line of each, with the exit code of one.
TEST_F(Check, ListsAllErrors) {
  const Outcome outcome = check("<shape type='cubus'/>\n<bsdf type='difuse'/>\n<shape type='obj'/>");
  EXPECT_EQ(outcome.code, 2);
  EXPECT_EQ(outcome.out, "");
  const std::string place = "candela: error: " + (folder_ / "scene.xml").string();
  EXPECT_EQ(outcome.err, place + ":4: unknown shape 'cubus' (did you mean 'cube'?)\n" + place +
                             ":5: unknown bsdf 'difuse' (did you mean 'diffuse'?)\n" + place +
                             ":6: shape 'obj' lacks the parameter 'filename'\n");
  std::string many;
  for (int i = 0; i < 30; ++i) many += "<shape type='cubus'/>\n";
  const Outcome bounded = check(many);
  EXPECT_EQ(std::count(bounded.err.begin(), bounded.err.end(), '\n'), 21) << bounded.err;
  EXPECT_NE(bounded.err.find("there may be more than these 20 errors"), std::string::npos) << bounded.err;
}

// Claim: all files that a scene names and that cannot be read are listed, with the line of each.
TEST_F(Check, ListsAllMissingFiles) {
  const auto mesh = [](const char* file) {
    return std::string("<shape type='ply'><string name='filename' value='") + file + "'/></shape>\n";
  };
  const Outcome outcome =
      check(mesh("one.ply") + mesh("two.ply") + mesh("one.ply") +
            "<shape type='cube'><bsdf type='diffuse'><texture type='bitmap' name='reflectance'>"
            "<string name='filename' value='three.png'/></texture></bsdf></shape>");
  EXPECT_EQ(outcome.code, 2);
  EXPECT_EQ(outcome.out, "");
  EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 4) << outcome.err;
  for (const char* part :
       {":4: file 'one.ply'", ":5: file 'two.ply'", ":6: file 'one.ply'", ":7: file 'three.png'"})
    EXPECT_NE(outcome.err.find((folder_ / "scene.xml").string() + part), std::string::npos) << outcome.err;
}

// Claim: a scene without any light is told to be black; an old one gets a sky, which is told.
TEST_F(Check, DarkScenes) {
  const Outcome dark = check("<shape type='cube'/>");
  EXPECT_EQ(dark.code, 0) << dark.err;
  EXPECT_NE(dark.out.find("warning: scene.xml:1: the scene has no light: its picture is black\n"),
            std::string::npos)
      << dark.out;
  EXPECT_EQ(check("<shape type='cube'/>", {"--strict"}).code, 1);
  const Outcome old = check("<shape type='cube'/>", {}, "path", "0.6.0");
  EXPECT_EQ(old.code, 0) << old.err;
  EXPECT_NE(old.out.find("the scene has no light: a sun and a sky are added, as in 0.6"), std::string::npos)
      << old.out;
  EXPECT_EQ(old.out.find("black"), std::string::npos) << old.out;
}

// Claim: an old file's words are taken for today's, and what became of them is told.
TEST_F(Check, OldFiles) {
  const Outcome outcome = check(
      "<shape type='sphere'><bsdf type='conductor'/></shape><emitter type='point'><blackbody "
      "name='intensity' "
      "temperature='3200K' scale='0.01'/></emitter>",
      {}, "path", "0.6.0");
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("bsdf: conductor"), std::string::npos);
}

}  // namespace
}  // namespace candela::client
