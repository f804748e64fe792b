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

namespace candela::client {
namespace {

namespace fs = std::filesystem;

struct Outcome {
  int code;
  std::string out, err;
};

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

  static Outcome run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "candela");
    std::ostringstream out, err;
    const int code = run_program(arguments, out, err);
    return {code, out.str(), err.str()};
  }
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

// Claim: "--png=" does not take the next word for its value; it is refused.
TEST_F(Outputs, AnEqualsSignWithoutAValueIsRefused) {
  const Outcome r = run({"render", in_folder("scene.xml"), "-o", in_folder("x.exr"), "--png=", "--quiet"});
  EXPECT_EQ(r.code, 2);
  EXPECT_EQ(r.err,
            "candela: error: --png= has no value (write it as --png=VALUE, or leave the option out)\n");
}

}  // namespace
}  // namespace candela::client
