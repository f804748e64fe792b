// candela plan: what is said of a scene before it is rendered.
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "client/embedded/app.h"
#include "tests/temporary_folder.h"

namespace candela::client {
namespace {

std::string plan(const std::string& content, std::vector<std::string> options) {
  const test::TemporaryFolder folder;
  const auto scene = folder.path() / "scene.xml";
  std::ofstream(scene, std::ios::binary) << "<scene version='3.0.0'><integrator type='path'/>"
                                            "<sensor type='perspective'/>"
                                         << content << "</scene>";
  options.insert(options.begin(), {"candela", "plan", scene.string()});
  std::ostringstream out, err;
  EXPECT_EQ(run_program(options, out, err), 0) << err.str();
  return out.str();
}
void expect_line(const std::string& plan, const std::string& start) {
  EXPECT_NE(plan.find("\n" + start), std::string::npos) << "no line starts '" << start << "' in\n" << plan;
}

constexpr const char* kSky = "<shape type='cube'/><emitter type='constant'/>";
constexpr const char* kGlass =
    "<shape type='sphere'><bsdf type='dielectric'/></shape><emitter type='constant'/>";
constexpr const char* kPoint = "<shape type='cube'/><emitter type='point'/>";
constexpr const char* kMirrors =
    "<shape type='cube'><bsdf type='conductor'/></shape><shape type='sphere'><emitter type='area'/>"
    "<bsdf type='conductor'/></shape>";

// Claim: where light comes evenly from everywhere the plan says that Metropolis gains nothing, and why; where
// it may gain, what by.
TEST(Plan, SaysWhereMetropolisCannotPay) {
  const std::vector<std::string> forms[] = {
      {"--integrator", "pssmlt"}, {"--integrator", "pssmlt", "--set", "over=path"}, {"--integrator", "mmlt"}};
  for (const auto& form : forms) {
    const std::string sky = plan(kSky, form), glass = plan(kGlass, form);
    expect_line(sky, "skip a gain by Metropolis: nothing here is hard to find");
    EXPECT_EQ(sky.find("use  Metropolis"), std::string::npos) << sky;
    expect_line(glass, "use  Metropolis: light may be hard to find: specular surfaces\n");
    EXPECT_EQ(glass.find("a gain by Metropolis"), std::string::npos) << glass;
  }
  EXPECT_EQ(plan(kSky, {"--integrator", "path"}).find("Metropolis"), std::string::npos);
}

// Claim: mmlt's plan leaves out techniques that no path has, and lengths that then have none.
TEST(Plan, LeavesImpossibleTechniquesOutOfTheChoice) {
  const std::vector<std::string> mmlt = {"--integrator", "mmlt"};
  const std::string sky = plan(kSky, mmlt), point = plan(kPoint, mmlt), mirrors = plan(kMirrors, mmlt);
  expect_line(sky, "use  light met by the eye's walk (s = 0)");
  expect_line(sky, "skip light that meets the lens (t = 0): the lens is a point");
  expect_line(sky, "use  path lengths: from 1 edges");
  expect_line(point, "skip light met by the eye's walk (s = 0): no ray can hit an emitter");
  expect_line(point, "use  path lengths: from 2 edges");
  for (const char* technique : {"next event estimation (s = 1)", "connections of vertices (s > 1, t > 1)",
                                "connections to the lens (t = 1)", "light that meets the lens (t = 0)"})
    expect_line(mirrors, "skip " + std::string(technique) + ": ");
}

}  // namespace
}  // namespace candela::client
