// candela reproduce: from an image to the command that makes it again, and to the same bits; what it refuses,
// and what it says is missing.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <sstream>

#include "client/embedded/app.h"
#include "client/embedded/commands.h"
#include "client/settings.h"
#include "common/base/files.h"
#include "common/base/shell_words.h"
#include "common/image/bits.h"
#include "common/image/image.h"
#include "common/job/render_command.h"
#include "tests/integrators.h"
#include "tests/unit/client_outcome.h"

namespace candela::client {
namespace {

namespace fs = std::filesystem;

class ReproduceTest : public CommandTest {
 protected:
  void SetUp() override {
    CommandTest::SetUp();
    write_scene("scene.xml", "0.5");
  }
  static Outcome run(std::vector<std::string> arguments) { return run_candela(arguments); }
  std::string in_folder(const std::string& name) const { return (folder_.path() / name).string(); }
  void write_scene(const std::string& name, const std::string& reflectance) {
    std::ofstream(in_folder(name))
        << "<scene version='3.0.0'><default name='lamp' value='1'/><sensor type='perspective'>"
           "<float name='fov' value='60'/><transform name='to_world'><lookat origin='0,0,4' target='0,0,0' "
           "up='0,1,0'/></transform><film type='hdrfilm'><integer name='width' value='12'/>"
           "<integer name='height' value='8'/><rfilter type='tent'><float name='radius' "
           "value='0.8'/></rfilter>"
           "</film><sampler type='independent'><integer name='seed' value='5'/></sampler></sensor>"
           "<shape type='sphere'><bsdf type='diffuse'><rgb name='reflectance' value='"
        << reflectance
        << "'/></bsdf></shape><shape type='sphere'><point name='center' x='2' y='2' z='2'/><float "
           "name='radius' "
           "value='0.3'/><emitter type='area'><rgb name='radiance' value='$lamp'/></emitter></shape></scene>";
  }
  // An image of the scene, by these options.
  std::string render(const std::string& name, std::vector<std::string> options) {
    const std::string file = in_folder(name);
    std::vector<std::string> arguments{"render", in_folder("scene.xml"), "-o", file, "--quiet"};
    arguments.insert(arguments.end(), options.begin(), options.end());
    const Outcome r = run(arguments);
    EXPECT_EQ(r.code, 0) << r.err;
    return file;
  }
  static std::string text(const std::string& file, const std::string& name) {
    const auto texts = image::read_texts(file);
    EXPECT_TRUE(texts.ok());
    const auto found = texts->find("candela:" + name);
    return found == texts->end() ? "-" : found->second;
  }
  // The same under other texts, of which an empty one is not there, and with other pixels.
  std::string with_texts(const std::string& file, const std::map<std::string, std::string>& changes,
                         const std::function<void(std::vector<float>&)>& change = {}) {
    auto texts = *image::read_texts(file);
    for (const auto& [name, value] : changes) {
      texts.erase("candela:" + name);
      if (!value.empty()) texts["candela:" + name] = value;
    }
    std::erase_if(texts, [](const auto& entry) { return !entry.first.starts_with("candela:"); });
    auto image = image::read_image(file);
    EXPECT_TRUE(image.ok());
    if (change) change(image->rgb);
    const auto bytes = image::encode_exr(image->width, image->height, image->rgb, texts);
    EXPECT_TRUE(bytes.ok()) << bytes.error().to_string();
    EXPECT_TRUE(write_file_atomically(in_folder("changed.exr"), *bytes).ok());
    return in_folder("changed.exr");
  }
};

// Claim: an image says which indices of each half it has, where its scene lay, and the command; the command,
// run as it is printed, makes the same bits, and `--run` says so. So do images with all kinds of options that
// change pixels or layers.
TEST_F(ReproduceTest, TheCommandMakesTheSameBits) {
  const std::vector<std::vector<std::string>> cases = {
      {"--spp", "5"},
      {"--iterations", "3", "--integrator", "pssmlt", "--set", "chains=8", "--set", "bootstrap=100",
       "--chain-layers"},
      {"--indices", "2-4,7/0,5", "-D", "lamp=2, 3, 0.5", "--filter", "gaussian", "--sampler", "sobol",
       "--aov", "albedo,d:depth", "--error-layer", "--variance-layer", "--seed", "18446744073709551615"},
      {"--spp", "4", "--integrator", "optimis", "--half", "B"},
      {"--spp", "8", "--size", "7x5", "--integrator", "vcm", "--set", "max_depth=3"}};
  for (const auto& options : cases) {
    SCOPED_TRACE(testing::PrintToString(options));
    const std::string file = render("out.exr", options);
    EXPECT_EQ(text(file, "scene"), in_folder("scene.xml"));
    const Outcome printed = run({"reproduce", file});
    EXPECT_EQ(printed.code, 0);
    EXPECT_EQ(printed.err, "");
    EXPECT_EQ(printed.out, text(file, "reproduce") + "\n");
    auto words = split_shell_line(printed.out.substr(0, printed.out.size() - 1));
    ASSERT_TRUE(words.ok());
    ASSERT_EQ(words->at(4), "reproduced.exr");
    words->at(4) = in_folder("again.exr");
    words->push_back("--quiet");
    words->erase(words->begin());
    const Outcome made = run(*words);
    ASSERT_EQ(made.code, 0) << made.err;
    const auto bits = image::compare_bits(file, in_folder("again.exr"));
    ASSERT_TRUE(bits.ok());
    EXPECT_TRUE(bits->missing.empty() && bits->differing.empty());
    const auto first = *image::read_texts(file), second = *image::read_texts(in_folder("again.exr"));
    for (const auto& [name, value] : first)
      if (name != "candela:job" && !name.starts_with("candela:run:")) {
        EXPECT_EQ(second.contains(name) ? second.at(name) : "-", value) << name;
      }

    const Outcome again = run({"reproduce", file, "--run", "--quiet"});
    EXPECT_EQ(again.code, 0) << again.err;
    EXPECT_EQ(again.out.substr(0, 7), "equal: ") << again.out << again.err;
  }
  EXPECT_EQ(text(render("three.exr", {"--spp", "3"}), "indices_a"), "0-1");
  EXPECT_EQ(text(in_folder("three.exr"), "indices_b"), "0");
  EXPECT_EQ(fs::exists(in_folder("three.exr.candela")), false);
}

// Claim: pixels that differ are counted, the channels named, and the exit code is 1; -o keeps the image that
// was made, and never overwrites the one that is compared.
TEST_F(ReproduceTest, DifferencesAreTold) {
  const std::string file = render("out.exr", {"--spp", "2"});
  const std::string other = with_texts(
      file, {}, [](std::vector<float>& rgb) { rgb[3 * 17 + 1] = std::nextafter(rgb[3 * 17 + 1], 1e9F); });
  const Outcome r = run({"reproduce", other, "--run", "-o", in_folder("again.exr"), "--quiet"});
  EXPECT_EQ(r.code, 1);
  EXPECT_EQ(r.out, "not equal: 1 of 96 pixels differ, in G\n");
  EXPECT_TRUE(image::compare_bits(file, in_folder("again.exr"))->differing.empty());
  EXPECT_NE(run({"reproduce", file, "--run", "-o", file}).err.find("would be overwritten"),
            std::string::npos);
}

// Claim: a scene that is gone, or has changed, is told with the command, and with --run nothing is rendered;
// --scene names it where it is now, also in the command. Another build is told, and is no reason not to try.
TEST_F(ReproduceTest, WhatIsMissingIsTold) {
  const std::string file = render("out.exr", {"--spp", "2"});
  fs::create_directories(in_folder("moved"));
  fs::rename(in_folder("scene.xml"), in_folder("moved/scene.xml"));
  Outcome r = run({"reproduce", file});
  EXPECT_EQ(r.code, 0);
  const std::string gone = "scene.xml: the image's scene is not there (give it by --scene PATH)";
  EXPECT_NE(r.err.find(gone), std::string::npos) << r.err;
  r = run({"reproduce", file, "--run", "--quiet"});
  EXPECT_EQ(r.code, 2);
  EXPECT_NE(r.err.find(gone), std::string::npos) << r.err;
  r = run({"reproduce", file, "--scene", in_folder("moved/scene.xml")});
  EXPECT_EQ(r.err, "");
  EXPECT_NE(r.out.find(in_folder("moved/scene.xml")), std::string::npos);
  r = run({"reproduce", file, "--run", "--quiet", "--scene", in_folder("moved/scene.xml")});
  EXPECT_EQ(r.code, 0) << r.err;

  write_scene("scene.xml", "0.6");
  r = run({"reproduce", file});
  EXPECT_EQ(r.code, 0);
  EXPECT_NE(r.err.find("has changed since the image was made"), std::string::npos) << r.err;
  r = run({"reproduce", file, "--run", "--quiet"});
  EXPECT_EQ(r.code, 2);
  EXPECT_NE(r.err.find("has changed since the image was made"), std::string::npos) << r.err;

  write_scene("scene.xml", "0.5");
  const std::string built = with_texts(file, {{"build_id", "another"}});
  for (const bool runs : {false, true}) {
    r = run(runs ? std::vector<std::string>{"reproduce", built, "--run", "--quiet"}
                 : std::vector<std::string>{"reproduce", built});
    EXPECT_EQ(r.code, 0) << r.err;
    EXPECT_NE(r.err.find("build another; this is build"), std::string::npos) << r.err;
  }
  r = run({"reproduce", with_texts(file, {{"settings", "max_depth=2"}}), "--run"});
  EXPECT_EQ(r.code, 2);
  EXPECT_NE(r.err.find("settings come out as"), std::string::npos) << r.err;
}

// Claim: what cannot be made again is refused with one error and code 2: no image, an image of another
// program, one of a version before sets, one with samples of a distrusted worker, one without a command, and
// one whose command is another's.
TEST_F(ReproduceTest, RefusesWhatItCannotMake) {
  const std::string file = render("out.exr", {"--spp", "1"});
  const auto refused = [&](const std::string& image, const std::string& part) {
    for (const bool runs : {false, true}) {
      const Outcome r = run(runs ? std::vector<std::string>{"reproduce", image, "--run"}
                                 : std::vector<std::string>{"reproduce", image});
      EXPECT_EQ(r.code, 2) << r.err;
      EXPECT_EQ(r.out, "");
      EXPECT_NE(r.err.find(part), std::string::npos) << r.err;
      EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << r.err;
    }
  };
  refused(in_folder("none.exr"), "none.exr");
  refused(in_folder("scene.xml"), "scene.xml");
  refused(with_texts(file, {{"build_id", ""}}), "no image of Candela");
  refused(with_texts(file, {{"indices_a", ""}, {"reproduce", ""}}), "does not say which samples it has");
  refused(with_texts(file, {{"run:taint", "worker x is distrusted"}}), "worker x is distrusted");
  refused(with_texts(file, {{"run:builds", "0.1.0-1, 0.1.0-2"}}),
          "samples of several builds: 0.1.0-1, 0.1.0-2");
  refused(with_texts(file, {{"reproduce", ""}}), "tells of no command");
  refused(with_texts(file, {{"reproduce", "candela render s.xml --size 4x4 --indices 0/0 --page :1"}}),
          "candela:reproduce cannot be used");
  for (const auto& [more, part] :
       {std::pair<std::vector<std::string>, const char*>{{"--master", "a:1"}, "--run"},
        {{"--threads", "1"}, "--run"},
        {{"--run", "--resume"}, "--resume"},
        {{"--run", "--master", "a:1", "--threads", "1"}, "--master"}}) {
    std::vector<std::string> arguments{"reproduce", file};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Outcome r = run(arguments);
    EXPECT_EQ(r.code, 2);
    EXPECT_NE(r.err.find(part), std::string::npos) << r.err;
  }
}

// Claim: for every integrator the settings of a job, whatever decided them, are those that its command's
// options decide again: nothing is derived anew.
TEST_F(ReproduceTest, SettingsOfEveryIntegratorComeOutTheSame) {
  const RendererFacts facts = renderer_facts();
  for (const std::string& integrator : facts.integrator_names()) {
    SceneOptions options;
    options.scene = in_folder("scene.xml");
    options.integrator = integrator;
    options.time = "3s";
    const auto first = load_scene(options, facts);
    ASSERT_TRUE(first.ok()) << first.error().to_string();
    SceneOptions again;
    again.scene = options.scene;
    again.integrator = integrator;
    again.lenient = true;
    again.indices = "0-3/0-2";
    for (const auto& [name, value] : first->job.settings.integrator_settings)
      again.sets.push_back(name + '=' + value);
    again.filter = first->job.settings.filter;
    const auto second = load_scene(again, facts);
    ASSERT_TRUE(second.ok()) << integrator << ": " << second.error().to_string();
    EXPECT_EQ(difference(second->job.settings, first->job.settings), "") << integrator;
    EXPECT_EQ(second->gathered.bundle.hash(), first->gathered.bundle.hash());
  }
}

}  // namespace
}  // namespace candela::client
