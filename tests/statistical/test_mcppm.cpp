// mcppm against ppm at one radius. Given the eye paths both estimate the same integral, so their expectations
// are equal at any radius: no margin. The test is that of block_tests.h; each pair alarms falsely with
// probability at most 1e-5, and there are a dozen.
//
// Chains run whatever the pilot finds (plan=full), so that visible fractions from 0.001 to 1 are tested.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <string>
#include <vector>

#include "tests/proofs/proofs.h"
#include "tests/statistical/harness.h"
#include "tests/statistical/moments.h"

namespace candela::statistical {
namespace {

// Films decide these tests: proofs.h.
const proofs::FilmsDecide kFilms({"McppmAndPpm", "McppmGain"});

constexpr std::uint32_t kExtent = 16;
const Regions kRegions(kExtent, kExtent, 8);

std::string scene_text(const std::string& body, const std::string& camera) {
  return R"(<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="6"/></integrator>
    <sensor type="perspective"><float name="fov" value="50"/><transform name="to_world">)" +
         camera + "</transform></sensor>" + body + "</scene>";
}

// Two rooms and a wall with a hole between them, `hole` by `hole`; the lamp is in the other room.
std::string keyhole(double hole, const std::string& more = "") {
  const auto wall = [&](double x, double y, double width, double height) {
    return fmt::format(
        R"(<shape type="rectangle"><transform name="to_world"><scale x="{}" y="{}"/><translate x="{}" y="{}"/></transform>
        <bsdf type="twosided"><bsdf type="diffuse"/></bsdf></shape>)",
        width / 2, height / 2, x, y);
  };
  const double side = (2 - hole) / 2, middle = (2 + hole) / 4;
  return scene_text(
      R"(<shape type="cube"><transform name="to_world"><scale z="2"/></transform>
      <bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="0.6, 0.5, 0.4"/></bsdf></bsdf></shape>
      <shape type="rectangle"><transform name="to_world"><scale value="0.5"/><translate z="-1.9"/></transform>
        <emitter type="area"><rgb name="radiance" value="40, 50, 60"/></emitter></shape>)" +
          wall(middle, 0, side, 2) + wall(-middle, 0, side, 2) + wall(0, middle, hole, side) +
          wall(0, -middle, hole, side) + more,
      R"(<lookat origin="0.8, 0.5, 0.2" target="-0.3, -0.4, 2" up="0, 1, 0"/>)");
}

// A floor under a sky and a sun, of which the camera sees a small part.
std::string patch(double floor) {
  return scene_text(
      fmt::format(
          R"(<shape type="rectangle"><transform name="to_world"><scale value="{}"/><rotate x="1" angle="-90"/></transform></shape>
          <shape type="sphere"><point name="center" x="0.2" y="0.3" z="0"/><float name="radius" value="0.3"/><bsdf type="dielectric"/></shape>
          <emitter type="constant"><rgb name="radiance" value="0.3, 0.4, 0.5"/></emitter>
          <emitter type="directional"><vector name="direction" x="0.4" y="-1" z="0.3"/><rgb name="irradiance" value="3, 3, 2"/></emitter>)",
          floor),
      R"(<lookat origin="0, 2, 2" target="0, 0, 0" up="0, 1, 0"/>)");
}

// The hole is full of fog, and behind a mask.
const std::string kFog =
    R"(<shape type="cube"><transform name="to_world"><scale x="0.7" y="0.7" z="0.5"/><translate z="1.2"/></transform><bsdf type="null"/>
    <medium name="interior" type="homogeneous"><rgb name="sigma_t" value="0.6, 0.8, 1"/><float name="albedo" value="0.9"/></medium></shape>)";
const std::string kBall =
    R"(<shape type="sphere"><point name="center" x="-0.3" y="-0.6" z="1.4"/><float name="radius" value="0.35"/><bsdf type="dielectric"/></shape>
    <shape type="sphere"><point name="center" x="0.5" y="-0.7" z="1.2"/><float name="radius" value="0.3"/><bsdf type="plastic"/></shape>)";

struct Case {
  const char* name;
  std::string text;
  const char* radius;       // of the bounding sphere's
  const char* light_paths;  // per pixel
  SettingsMap more = {};    // of mcppm
  bool nightly = false;     // of the long form alone
};

std::vector<Case> cases() {
  return {{"keyhole", keyhole(0.2, kBall), "0.05", "8"},
          {"keyhole_long", keyhole(0.2, kBall), "0.05", "2", {{"mutations_per_path", "10"}}, true},
          {"keyhole_large_steps", keyhole(0.2, kBall), "0.05", "8", {{"step", "0.5"}, {"lag", "64"}}, true},
          {"narrow_keyhole", keyhole(0.06), "0.1", "16", {}, true},
          {"open", keyhole(1.8, kBall), "0.05", "2", {}, true},
          {"everything", keyhole(1.8, kBall), "0.3", "2"},
          {"fog", keyhole(0.4, kFog), "0.08", "4"},
          {"patch", patch(6), "0.02", "8"},
          {"far_patch", patch(40), "0.003", "32"},
          {"no_mutations", keyhole(0.2, kBall), "0.05", "8", {{"mutations_per_path", "0.001"}}, true}};
}

class McppmAndPpm : public testing::TestWithParam<std::string> {};

TEST_P(McppmAndPpm, AgreeAtOneRadius) {
  for (const Case& one : cases()) {
    if (one.name != GetParam()) continue;
    const TestScene scene = scene_from_xml(one.text, kExtent, kExtent);
    SettingsMap both = {{"radius", one.radius}, {"alpha", "1"}, {"light_paths", one.light_paths}};
    SettingsMap own = both;
    own.insert(one.more.begin(), one.more.end());
    own.insert({{"plan", "full"}, {"epoch_min", "2"}});
    BatchPlan plan;
    plan.seed = 4500;
    plan.iterations = long_form() ? 128 : 8;
    plan.batches = 24;
    const auto mcppm = make_estimator("mcppm", {{1.0, with_integrator(scene, "mcppm", own)}}, plan, kRegions);
    plan.seed = 9000;
    const auto ppm = make_estimator("ppm", {{1.0, with_integrator(scene, "ppm", both)}}, plan, kRegions);
    BlockTest test;
    test.effort_reference = 2;
    const Verdict verdict = compare(mcppm, ppm, kRegions, test);
    std::printf("%s\n%s\n", one.name, verdict.report.c_str());
    EXPECT_TRUE(verdict.agree);
    EXPECT_GT(verdict.tested * 2, verdict.values) << verdict.report;
  }
}

std::vector<std::string> names() {
  std::vector<std::string> all;
  for (const Case& one : cases())
    if (long_form() || !one.nightly) all.emplace_back(one.name);
  return all;
}
INSTANTIATE_TEST_SUITE_P(Mcppm, McppmAndPpm, testing::ValuesIn(names()),
                         [](const auto& one) { return one.param; });

// Sums of the relative variances of pixels, of ppm over mcppm, at equal numbers of light paths.
double gain(const std::string& text, const char* radius, int light_paths) {
  const TestScene scene = scene_from_xml(text, kExtent, kExtent);
  const auto variance = [&](const std::string& integrator, int paths, const SettingsMap& more) {
    SettingsMap settings = {{"radius", radius}, {"alpha", "1"}, {"light_paths", fmt::format("{}", paths)}};
    settings.insert(more.begin(), more.end());
    BatchPlan plan;
    plan.seed = 7700;
    plan.batches = 32;
    plan.iterations = 4;
    ImageMoments moments;
    for (const auto& image : render_images({{1.0, with_integrator(scene, integrator, settings)}}, plan))
      add_image(moments, image);
    Moments brightness, spread;
    for (const Moments& pixel : moments) {
      brightness.add(pixel.mean());
      spread.add(pixel.variance());
    }
    return spread.mean() / (brightness.mean() * brightness.mean());
  };
  return variance("ppm", 2 * light_paths, {}) /
         variance("mcppm", light_paths, {{"plan", "full"}, {"epoch_min", "2"}});
}

// Claim: at equal numbers of light paths chains win by far where few paths are visible, and where all are
// they lose at most a factor of two [metropolis-photons note, sections 6 and 8].
TEST(McppmGain, ChainsWinWhereFewPathsAreVisible) {
  const double detail = gain(patch(40), "0.003", 32), all = gain(keyhole(1.8, kBall), "0.3", 2);
  std::printf("ppm's variance over mcppm's: a detail of a floor %.2f, all visible %.2f\n", detail, all);
  EXPECT_GT(detail, 10);
  EXPECT_GT(all, 0.45);
  EXPECT_LT(all, 1.1);
}

}  // namespace
}  // namespace candela::statistical
