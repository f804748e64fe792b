// Names of files on the command line: empty ones, symbolic links, and what is no file.
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "client/embedded/app.h"
#include "client/output.h"
#include "common/base/files.h"
#include "tests/unit/client_outcome.h"

namespace candela::client {
namespace {

namespace fs = std::filesystem;

class Outputs : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(folder_);
    std::ofstream(folder_ / "scene.xml")
        << "<scene version='3.0.0'><integrator type='path'/><sensor type='perspective'><film type='hdrfilm'>"
           "<integer name='width' value='8'/><integer name='height' value='8'/></film></sensor>"
           "<emitter type='constant'/></scene>";
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string in_folder(const std::string& name) const { return (folder_ / name).string(); }

  static Outcome run(std::vector<std::string> arguments) { return run_candela(arguments); }
  Outcome render(const std::string& output) const {
    return run({"render", in_folder("scene.xml"), "--iterations", "1", "--quiet", "-o", output});
  }
  std::size_t entries() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
  }

  const fs::path folder_ = fs::path(testing::TempDir()) / ("outputs-" + std::to_string(::getpid()));
};

// Claim: an empty name of a file or folder, which an unset variable of a script gives, is refused at once by
// every option that takes one; the error names the option and the mend.
TEST_F(Outputs, EmptyNamesAreRefused) {
  const std::string scene = in_folder("scene.xml"), exr = in_folder("x.exr");
  const struct {
    std::vector<std::string> arguments;
    std::string option;
  } cases[] = {
      {{"render", scene, "--iterations", "1", "-o", ""}, "--output"},
      {{"render", scene, "--iterations", "1", "--output", ""}, "--output"},
      {{"render", scene, "--iterations", "1", "-o", exr, "--png", ""}, "--png"},
      {{"render", "", "-o", exr}, "scene"},
      {{"plan", ""}, "scene"},
      {{"check", ""}, "scene"},
      {{"submit", "", "--master", "127.0.0.1:1"}, "scene"},
      {{"submit", scene, "--master", "127.0.0.1:1", "--wait", "-o", ""}, "--output"},
      {{"submit", scene, "--master", "127.0.0.1:1", "--wait", "--png", ""}, "--png"},
      {{"fetch", "j1", "--master", "127.0.0.1:1", "-o", ""}, "--output"},
      {{"fetch", "j1", "--master", "127.0.0.1:1", "-o", exr, "--png", ""}, "--png"},
      {{"list", "--master", "127.0.0.1:1", "--tls-cert", ""}, "--tls-cert"},
      {{"list", "--master", "127.0.0.1:1", "--tls-key", ""}, "--tls-key"},
      {{"list", "--master", "127.0.0.1:1", "--tls-ca", ""}, "--tls-ca"},
      {{"convert", exr, ""}, "output"},
      {{"convert", "", in_folder("x.png")}, "input"},
      {{"compare", "", exr}, "image"},
      {{"inspect", "falsecolor", "", "-o", in_folder("x.png")}, "image"},
      {{"inspect", "falsecolor", exr, "-o", ""}, "--output"},
      {{"inspect", "falsecolor", exr, "-o", in_folder("x.png"), "--minus", ""}, "--minus"},
      {{"compare", exr, ""}, "reference"},
  };
  for (const auto& c : cases) {
    const Outcome r = run(c.arguments);
    const std::string shown = testing::PrintToString(c.arguments) + "\n" + r.err;
    EXPECT_EQ(r.code, 2) << shown;
    EXPECT_TRUE(
        r.err.starts_with("candela: error: " + c.option + ": the name of a file or folder is empty (give "))
        << shown;
    EXPECT_EQ(r.out, "") << shown;
  }
  EXPECT_EQ(entries(), 1U);  // the scene
}

// Claim: a half is A or B, and has no error layer; both are told before a master is called.
TEST_F(Outputs, HalvesThatCannotBeAreRefused) {
  const Outcome other =
      run({"fetch", "j1", "--master", "127.0.0.1:1", "-o", in_folder("x.exr"), "--half", "C"});
  EXPECT_EQ(other.code, 2);
  EXPECT_EQ(other.err, "candela: error: --half: 'C' is neither A nor B\n");
  const Outcome both = run(
      {"fetch", "j1", "--master", "127.0.0.1:1", "-o", in_folder("x.exr"), "--half", "A", "--error-layer"});
  EXPECT_EQ(both.code, 2);
  EXPECT_NE(both.err.find("--half and --error-layer exclude each other"), std::string::npos) << both.err;
  const Outcome variance = run({"fetch", "j1", "--master", "127.0.0.1:1", "-o", in_folder("x.exr"), "--half",
                                "A", "--variance-layer"});
  EXPECT_EQ(variance.code, 2);
  EXPECT_NE(variance.err.find("--half and --variance-layer exclude"), std::string::npos) << variance.err;
}

// Claim: "--png=" does not take the next word for its value; it is refused.
TEST_F(Outputs, AnEqualsSignWithoutAValueIsRefused) {
  const Outcome r = run({"render", in_folder("scene.xml"), "-o", in_folder("x.exr"), "--png=", "--quiet"});
  EXPECT_EQ(r.code, 2);
  EXPECT_EQ(r.err,
            "candela: error: --png= has no value (write it as --png=VALUE, or leave the option out)\n");
}

// Claim: an output that is a symbolic link stays one; its target gets the image, whether it was there or not.
TEST_F(Outputs, LinksAreWrittenThrough) {
  fs::create_directories(folder_ / "store");
  fs::create_symlink("store/there.exr", folder_ / "there.exr");
  fs::create_symlink(folder_ / "there.exr", folder_ / "twice.exr");
  fs::create_symlink("store/new.exr", folder_ / "dangling.exr");
  std::ofstream(folder_ / "store/there.exr") << "old";
  for (const auto& [link, target] :
       {std::pair("twice.exr", "there.exr"), std::pair("dangling.exr", "new.exr")}) {
    const Outcome r = render(in_folder(link));
    EXPECT_EQ(r.code, 0) << r.err;
    EXPECT_TRUE(fs::is_symlink(folder_ / link)) << link;
    EXPECT_TRUE(fs::is_regular_file(fs::symlink_status(folder_ / "store" / target))) << target;
    EXPECT_GT(fs::file_size(folder_ / "store" / target), 100U);
  }
  EXPECT_TRUE(fs::is_symlink(folder_ / "there.exr"));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_ / "store"), fs::directory_iterator()), 2);
}

// Claim: an output that cannot be written is refused before anything is rendered: links that lead to
// themselves or into folders that are not there, folders, pipes, devices.
TEST_F(Outputs, WhatCannotBeWrittenIsRefusedFirst) {
  fs::create_symlink("loop2.exr", folder_ / "loop1.exr");
  fs::create_symlink("loop1.exr", folder_ / "loop2.exr");
  fs::create_symlink("nowhere/x.exr", folder_ / "lost.exr");
  fs::create_symlink("/dev/null", folder_ / "null.exr");
  fs::create_directories(folder_ / "folder.exr");
  ASSERT_EQ(::mkfifo((folder_ / "pipe.exr").c_str(), 0600), 0);
  const struct {
    const char* name;
    const char* part;
  } cases[] = {{"loop1.exr", "the symbolic link leads back to itself"},
               {"lost.exr", "there is no folder "},
               {"null.exr", "this is not a regular file"},
               {"folder.exr", "this is not a regular file"},
               {"pipe.exr", "this is not a regular file"}};
  const std::size_t before = entries();
  for (const auto& c : cases) {
    const Outcome r = render(in_folder(c.name));
    EXPECT_EQ(r.code, 2) << r.err;
    EXPECT_TRUE(r.err.starts_with("candela: error: --output: ")) << r.err;
    EXPECT_NE(r.err.find(c.part), std::string::npos) << r.err;
  }
  EXPECT_EQ(entries(), before);
}

// Claim: walks that Russian roulette ended at its bound on edges, between walls that absorb next to nothing,
// are told at the end of a render, with the count and the setting that finds their light, and counted in the
// JSON; where none are, nothing is said.
TEST_F(Outputs, TellOfLightThatRouletteLeavesOut) {
  const auto render_box = [&](const char* albedo) {
    std::ofstream(folder_ / "box.xml")
        << "<scene version='3.0.0'><integrator type='light'/><sensor type='perspective'><film type='hdrfilm'>"
           "<integer name='width' value='4'/><integer name='height' value='4'/></film></sensor>"
           "<shape type='sphere'><boolean name='flip_normals' value='true'/><bsdf type='diffuse'>"
           "<rgb name='reflectance' value='"
        << albedo << "'/></bsdf><emitter type='area'/></shape></scene>";
    return run({"render", in_folder("box.xml"), "--iterations", "8", "--json", "-o", in_folder("box.exr")});
  };
  const Outcome bright = render_box("0.999"), dark = render_box("0.5");
  ASSERT_EQ(bright.code, 0) << bright.err;
  const auto counted = [](const Outcome& r) {
    const std::string name = "\"bounded_walks\":";
    const std::size_t at = r.out.find(name);
    return at == std::string::npos ? -1 : std::stoi(r.out.substr(at + name.size()));
  };
  const int count = counted(bright);
  EXPECT_GT(count, 8 * 16 / 8);
  EXPECT_NE(bright.err.find("candela: warning: light is missing: Russian roulette ended " +
                            std::to_string(count) + " walks"),
            std::string::npos)
      << bright.err;
  EXPECT_NE(bright.err.find("rr_depth"), std::string::npos) << bright.err;
  ASSERT_EQ(dark.code, 0) << dark.err;
  EXPECT_EQ(counted(dark), 0);
  EXPECT_EQ(dark.err.find("warning"), std::string::npos) << dark.err;
}

}  // namespace
}  // namespace candela::client
