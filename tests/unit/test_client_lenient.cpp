// Scenes of other renderers at the command line: --integrator and --lenient, and what they say.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "client/embedded/app.h"
#include "common/image/image.h"
#include "tests/paths.h"
#include "tests/unit/client_outcome.h"

namespace candela::client {
namespace {

namespace fs = std::filesystem;

class ForeignScenes : public testing::Test {
 protected:
  void SetUp() override { fs::create_directories(folder_); }
  void TearDown() override { fs::remove_all(folder_); }

  // The command on a scene of this content, which has a sensor and a light besides.
  Outcome run(std::vector<std::string> command, const std::string& version,
              const std::string& content) const {
    std::ofstream(scene_) << "<scene version='" + version +
                                 "'>\n<sensor type='perspective'><film type='hdrfilm'><integer name='width' "
                                 "value='8'/><integer name='height' value='8'/></film></sensor><emitter "
                                 "type='constant'/>\n" +
                                 content + "</scene>";
    command.insert(command.begin(), "candela");
    command.insert(command.begin() + 2, scene_);
    if (command[1] == "render") {
      const std::vector<std::string> more = {"--iterations", "1",  "--fresh",
                                             "--quiet",      "-o", (folder_ / "out.exr").string()};
      command.insert(command.end(), more.begin(), more.end());
    }
    std::ostringstream out, err;
    const int code = run_program(command, out, err);
    return {code, out.str(), err.str()};
  }
  static std::size_t lines(const std::string& text) {
    return static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
  }

  const fs::path folder_ = fs::path(testing::TempDir()) / ("foreign-" + std::to_string(::getpid()));
  const std::string scene_ = (folder_ / "scene.xml").string();
};

// Claim: with --integrator, render, plan and check take a scene whose integrator is another renderer's, say
// in one note which it is, and keep what both know.
TEST_F(ForeignScenes, IntegratorsOfOthersAreNoObstacle) {
  const std::string content =
      "<integrator type='aovs'>\n<string name='aovs' value='nn:sh_normal'/><integrator type='path_sms_ss'>"
      "<integer name='max_depth' value='7'/><boolean name='caustics_biased' value='true'/></integrator>"
      "</integrator>\n";
  const std::string note =
      ":3: the scene asks for the integrator 'aovs', the command line for 'path'; of the scene's counts "
      "max_depth = 7\n";
  for (const std::string command : {"render", "plan"}) {
    EXPECT_EQ(run({command}, "3.0.0", content).code, 2);
    const Outcome r = run({command, "--integrator", "path"}, "3.0.0", content);
    EXPECT_EQ(r.code, 0) << r.err;
    EXPECT_EQ(r.err, "candela: note: " + scene_ + note);
  }
  const Outcome plan = run({"plan", "--integrator", "path", "--json"}, "3.0.0", content);
  EXPECT_EQ(nlohmann::json::parse(plan.out).at("integrator_settings").at("max_depth"), "7");
  const Outcome check = run({"check", "--integrator", "path"}, "3.0.0", content);
  EXPECT_EQ(check.code, 0) << check.err;
  EXPECT_NE(check.out.find("warning: scene.xml" + note), std::string::npos) << check.out;
}

// Claim: parameters of the scene's own integrator that mean nothing here do not keep it from rendering.
TEST_F(ForeignScenes, ParametersWithoutEffectAreAccepted) {
  const Outcome r =
      run({"plan", "--json"}, "3.0.0",
          "<integrator type='path'><integer name='block_size' value='32'/><boolean "
          "name='strict_normals' value='false'/><integer name='max_depth' value='7'/></integrator>");
  EXPECT_EQ(r.code, 0) << r.err;
  EXPECT_EQ(r.err, "");
  EXPECT_EQ(nlohmann::json::parse(r.out).at("integrator_settings").at("max_depth"), "7");
}

// Claim: strict_normals is the scene's, for its own integrator and for another one, which tells that it
// counts; it is no setting of any.
TEST_F(ForeignScenes, StrictNormalsAreTheScenes) {
  const std::string strict = "'><boolean name='strict_normals' value='true'/></integrator>";
  const Outcome own = run({"plan", "--json"}, "3.0.0", "<integrator type='path" + strict);
  EXPECT_EQ(own.code, 0) << own.err;
  EXPECT_EQ(own.err, "");
  EXPECT_FALSE(nlohmann::json::parse(own.out).at("integrator_settings").contains("strict_normals"));
  const Outcome other =
      run({"plan", "--json", "--integrator", "bdpt"}, "3.0.0", "<integrator type='path" + strict);
  EXPECT_EQ(other.code, 0) << other.err;
  EXPECT_TRUE(other.err.find("of the scene's counts strict_normals = true") != std::string::npos)
      << other.err;
  EXPECT_FALSE(nlohmann::json::parse(other.out).at("integrator_settings").contains("strict_normals"));
}

// Claim: what is passed over is a warning with file, line and nearest name, once however often it is there;
// in files before version 2 always, in later ones with --lenient; check has it in its list.
TEST_F(ForeignScenes, UnknownParametersAreWarnings) {
  std::string content = "<integrator type='path'/>\n";
  for (int i = 0; i < 100; ++i) content += "<shape type='cube'><float name='to_wrld' value='1'/></shape>\n";
  const std::string what =
      "shape 'cube' has no parameter 'to_wrld': it is passed over (did you mean 'to_world'?) (and 99 more "
      "like "
      "it)\n";
  EXPECT_EQ(run({"render"}, "3.0.0", content).code, 2);
  for (const auto& [version, option] : {std::pair("3.0.0", "--lenient"), std::pair("0.6.0", "--quiet")}) {
    const Outcome r = run({"render", option}, version, content);
    EXPECT_EQ(r.code, 0) << r.err;
    EXPECT_EQ(r.err, "candela: warning: " + scene_ + ":4: " + what);
  }
  const Outcome plan = run({"plan", "--lenient"}, "3.0.0", content);
  EXPECT_EQ(plan.code, 0) << plan.err;
  EXPECT_EQ(plan.err, "candela: warning: " + scene_ + ":4: " + what);
  const Outcome check = run({"check", "--lenient"}, "3.0.0", content);
  EXPECT_EQ(check.code, 0) << check.err;
  EXPECT_NE(check.out.find("warning: scene.xml:4: " + what), std::string::npos) << check.out;
  EXPECT_EQ(run({"check", "--lenient", "--strict"}, "3.0.0", content).code, 1);
  const Outcome submit =
      run({"submit", "--lenient", "--master", "127.0.0.1:1", "--timeout", "100ms"}, "3.0.0", content);
  EXPECT_EQ(submit.code, 3);
  EXPECT_TRUE(submit.err.starts_with("candela: warning: " + scene_ + ":4: " + what)) << submit.err;
}

// Claim: a scene without an integrator has 0.6's direct light in an old file and paths in a later one, with a
// warning; another one may be asked for.
TEST_F(ForeignScenes, NoIntegratorIsADefault) {
  const std::string content = "<shape type='cube'/>";
  const auto depth = [&](const std::string& version) {
    const Outcome plan = run({"plan", "--json"}, version, content);
    EXPECT_EQ(plan.code, 0) << plan.err;
    const auto document = nlohmann::json::parse(plan.out);
    EXPECT_EQ(document.at("integrator"), "path");
    return document.at("integrator_settings").at("max_depth").get<std::string>();
  };
  EXPECT_EQ(depth("0.6.0"), "2");
  EXPECT_EQ(depth("2.0.0"), "-1");
  EXPECT_EQ(depth("3.0.0"), "-1");
  for (const std::string command : {"render", "plan"}) {
    EXPECT_EQ(
        run({command}, "0.6.0", content).err,
        "candela: warning: " + scene_ +
            ":1: the scene has no integrator: 'direct' runs, path tracing with max_depth = 2, as in Mitsuba "
            "0.6\n");
    const Outcome later = run({command}, "3.0.0", content);
    EXPECT_EQ(later.code, 0);
    EXPECT_EQ(later.err, "candela: warning: " + scene_ +
                             ":1: the scene has no integrator: 'path' runs, as in Mitsuba\n");
    EXPECT_EQ(run({command, "--integrator", "bdpt"}, "3.0.0", content).err, "");
  }
  EXPECT_NE(run({"check"}, "0.6.0", content).out.find("warning: scene.xml:1: the scene has no integrator"),
            std::string::npos);
}

// Claim: what check warns of with a changed picture, render, plan and submit say in one line each.
TEST_F(ForeignScenes, ChangedPicturesAreTold) {
  const std::string content =
      "<integrator type='path'/>\n<shape type='sphere'><medium type='homogeneous' name='interior'/></shape>\n"
      "<shape type='sphere'><medium type='homogeneous' name='interior'/></shape>\n";
  const std::string told =
      "shape 'sphere' bounds a medium and has no bsdf: it is not seen, as in 0.6 and as Mitsuba 3 documents, "
      "though Mitsuba 3 makes it diffuse (write <bsdf type=\"null\"/> to have both agree) (and 1 more like "
      "it)\n";
  EXPECT_NE(run({"check"}, "3.0.0", content).out.find("warning: scene.xml:4: " + told), std::string::npos);
  for (const std::string command : {"render", "plan"}) {
    const Outcome r = run({command}, "3.0.0", content);
    EXPECT_EQ(r.code, 0) << r.err;
    EXPECT_EQ(r.err, "candela: warning: " + scene_ + ":4: " + told);
  }
  const Outcome submit = run({"submit", "--master", "127.0.0.1:1", "--timeout", "100ms"}, "3.0.0", content);
  EXPECT_TRUE(submit.err.starts_with("candela: warning: " + scene_ + ":4: " + told)) << submit.err;
  // A parameter of the film that changes the picture.
  const Outcome film = run({"plan"}, "3.0.0",
                           "<integrator type='path'/><sensor type='perspective'><film type='hdrfilm'><string "
                           "name='pixel_format' value='luminance'/></film></sensor>");
  EXPECT_EQ(film.err, "");  // of a sensor that does not count
}

// Claim: the cases of ../shared: a white rough plastic of 0.6 stays white in the mean, and a medium without a
// bsdf is told.
TEST_F(ForeignScenes, SharedCases) {
  const fs::path cases = test::shared_path() / "cases";
  const fs::path furnace = cases / "roughplastic" / "furnace.xml",
                 ball = cases / "null_medium_silent" / "nobsdf.xml";
  if (!fs::exists(furnace) || !fs::exists(ball))
    GTEST_SKIP() << "the folder ../shared with cases is not here";
  const std::string image = (folder_ / "furnace.exr").string();
  std::ostringstream out, err;
  ASSERT_EQ(run_program({"candela", "render", furnace.string(), "--spp", "16", "--size", "16x16", "--quiet",
                         "--fresh", "-o", image},
                        out, err),
            0)
      << err.str();
  const auto film = image::read_image(image);
  ASSERT_TRUE(film.ok()) << film.error().to_string();
  double sum = 0;
  for (const float value : film->rgb) sum += static_cast<double>(value);
  EXPECT_NEAR(sum / static_cast<double>(film->rgb.size()), 1, 0.01);
  const std::string dark = (folder_ / "ball.exr").string();
  std::ostringstream told;
  ASSERT_EQ(run_program({"candela", "render", ball.string(), "--spp", "1", "--quiet", "--fresh", "-o", dark},
                        out, told),
            0)
      << told.str();
  EXPECT_NE(told.str().find("bounds a medium and has no bsdf"), std::string::npos) << told.str();
}

// Claim: a hundred different warnings are twenty lines and their number.
TEST_F(ForeignScenes, WarningsDoNotFlood) {
  std::string content = "<integrator type='path'/>\n<shape type='cube'>\n";
  for (int i = 0; i < 100; ++i) content += "<float name='odd" + std::to_string(i) + "' value='1'/>\n";
  const Outcome r = run({"plan"}, "0.6.0", content + "</shape>\n");
  EXPECT_EQ(r.code, 0) << r.err;
  EXPECT_EQ(lines(r.err), 21U) << r.err;
  EXPECT_NE(r.err.find("80 more warnings; see them all by: candela check\n"), std::string::npos) << r.err;
}

}  // namespace
}  // namespace candela::client
