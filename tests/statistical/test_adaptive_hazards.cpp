// Tests the renderer's adaptive radii in known hard cases: the hazards of
// ../shared/theory/adaptive-kernels.md, section 8. docs/testing.md lists all of them.
//
// A floor of 24 x 24 pixels is seen from above, its light is known (tests/bench/candela_study/scenes). Claims
// are about levels of radii; seeds are fixed. Bounds were chosen so that the statistic lies four or more of
// its standard deviations over seeds inside.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "common/adaptive/levels.h"
#include "common/bundle/gather.h"
#include "tests/epoch_run.h"
#include "tests/paths.h"
#include "tests/statistical/harness.h"

namespace candela::statistical {
namespace {

constexpr std::uint32_t kSide = 24;
constexpr std::uint64_t kIterations = 512;

TestScene from_study(const std::string& name) {
  TestScene scene;
  scene.files = std::make_shared<bundle::DiskSource>(test::source_path("tests/bench/candela_study/scenes"));
  scene.main_key = name + ".xml";
  return read_scene(std::move(scene), kSide, kSide);
}

// The camera of the study's floor, over these things.
TestScene from_above(const std::string& things) {
  return scene_from_xml(
      "<scene version=\"3.0.0\"><integrator type=\"path\"><integer name=\"max_depth\" "
      "value=\"2\"/></integrator>"
      "<sensor type=\"orthographic\"><transform name=\"to_world\"><scale x=\"0.5\" y=\"0.5\" "
      "z=\"1\"/><lookat "
      "origin=\"0, 0, 1\" target=\"0, 0, 0\" up=\"0, 1, 0\"/></transform></sensor>" +
          things + "</scene>",
      kSide, kSide);
}

// Radii over the first one, row by row, after all iterations.
std::vector<double> radii_of(TestScene scene, const std::string& integrator, double radius_pixels,
                             SettingsMap settings = {}, std::uint64_t iterations = kIterations) {
  scene.settings.sampler = "independent";
  settings["radius_pixels"] = std::to_string(radius_pixels);
  const auto renderer = make_renderer(with_integrator(std::move(scene), integrator, settings));
  const auto pilot = renderer->pilot({});
  if (!pilot.ok()) throw std::runtime_error(pilot.error().to_string());
  if (!pilot->work.epochs) throw std::runtime_error("the plan merges nothing");
  const auto job = test::render_job(*renderer, *pilot, iterations, {2});
  if (!job.ok()) throw std::runtime_error(job.error().to_string());
  const auto levels = adaptive::get_levels(pilot->work.epochs->constants);
  if (!levels.ok()) throw std::runtime_error(levels.error().to_string());
  const std::vector<double> table = levels->radii(1);
  std::vector<double> radii;
  for (std::size_t i = 0; i < std::size_t{kSide} * kSide; ++i)
    radii.push_back(table[static_cast<unsigned char>(job->states.back()[i])]);
  return radii;
}

double share_shrunk(const std::vector<double>& radii) {
  const auto shrunk = std::count_if(radii.begin(), radii.end(), [](double r) { return r < 1; });
  return static_cast<double>(shrunk) / static_cast<double>(radii.size());
}
// The median over the pixels of these columns.
double median_of(const std::vector<double>& radii, std::uint32_t first_column, std::uint32_t end_column) {
  std::vector<double> chosen;
  for (std::size_t i = 0; i < radii.size(); ++i)
    if (i % kSide >= first_column && i % kSide < end_column) chosen.push_back(radii[i]);
  std::nth_element(chosen.begin(), chosen.begin() + static_cast<std::ptrdiff_t>(chosen.size() / 2),
                   chosen.end());
  return chosen[chosen.size() / 2];
}

// Claim: in even light about as many pixels shrink as the note says of looks at factors between 1 and 1.25
// (section 5.3: 0.18 and 0.12 after 512 iterations). About 46 discs of 2 pixels are independent.
TEST(AdaptiveHazards, EvenLightAlarmsAtItsRate) {
  const double share = share_shrunk(radii_of(from_study("flat"), "fppm", 2));
  std::printf("even light: %.3f of the pixels shrank\n", share);
  EXPECT_GT(share, 0.02);
  EXPECT_LT(share, 0.35);
}

// Claim: a texture at the eye's vertex has no effect on the F test: with the same photons the radii under a
// checker floor are those under a gray one, but for rounding.
TEST(AdaptiveHazards, EyeTexturesHaveNoEffect) {
  const auto floor = [](const std::string& reflectance) {
    return from_above(
        "<shape type=\"rectangle\"><bsdf type=\"diffuse\">" + reflectance +
        "</bsdf></shape><emitter type=\"directional\"><vector name=\"direction\" x=\"0\" y=\"0\" "
        "z=\"-1\"/></emitter>");
  };
  const auto gray = radii_of(floor("<rgb name=\"reflectance\" value=\"0.5\"/>"), "fppm", 2);
  const auto checker = radii_of(
      floor("<texture type=\"checkerboard\" name=\"reflectance\"><rgb name=\"color0\" value=\"0.9\"/><rgb "
            "name=\"color1\" value=\"0.1\"/><transform name=\"to_uv\"><scale "
            "value=\"4\"/></transform></texture>"),
      "fppm", 2);
  std::size_t others = 0;
  for (std::size_t i = 0; i < gray.size(); ++i) others += gray[i] != checker[i] ? 1 : 0;
  EXPECT_LT(others, gray.size() / 50);
  EXPECT_GT(share_shrunk(gray), 0);
}

// Claim: where two lights give one irradiance with unequal densities of photons, counts shrink the radius and
// the F test does not.
TEST(AdaptiveHazards, UnequalDensitiesDeceiveCounts) {
  const auto f = radii_of(from_study("two-lights"), "fppm", 3),
             counts = radii_of(from_study("two-lights"), "cppm", 3);
  std::printf("two lights: median radius beside the border, fppm %.2f, cppm %.2f\n", median_of(f, 11, 13),
              median_of(counts, 11, 13));
  EXPECT_EQ(median_of(f, 11, 13), 1);
  EXPECT_LT(median_of(counts, 11, 13), 0.8);
}

// Claim: the F test sees the texture of a light whose photons are even, counts do not.
TEST(AdaptiveHazards, TexturedLightsDeceiveCounts) {
  // Columns 11 and 12 lie beside an edge of the squares, at x = 0.
  const auto f = radii_of(from_study("checker"), "fppm", 3),
             counts = radii_of(from_study("checker"), "cppm", 3);
  std::printf("checker: median radius beside an edge, fppm %.2f, cppm %.2f\n", median_of(f, 11, 13),
              median_of(counts, 11, 13));
  EXPECT_LT(median_of(f, 11, 13), 0.6);
  EXPECT_EQ(median_of(counts, 11, 13), 1);
}

// Claim: a gradient shrinks radii, though it does not bias.
TEST(AdaptiveHazards, GradientsDeceiveSectors) {
  const auto radii = radii_of(from_study("gradient"), "fppm", 4);
  std::printf("gradient: median radius %.2f\n", median_of(radii, 0, kSide));
  EXPECT_LT(median_of(radii, 0, kSide), 0.8);
}

// Claim: curvature is seen: the light of a point close above has smaller radii below it than far away.
TEST(AdaptiveHazards, CurvatureShrinks) {
  const auto radii = radii_of(from_study("curvature"), "fppm", 6);
  double center = 0;
  for (const std::size_t row : {11U, 12U})
    for (const std::size_t column : {11U, 12U}) center += radii[row * kSide + column] / 4;
  std::printf("curvature: radius below the light %.2f\n", center);
  EXPECT_LT(center, 0.8);
}

// Claim: at a distance d from a shadow's edge radii end near d (note: 0.8 d); farther away than the first
// radius they are larger, as large as the gradient lets them.
TEST(AdaptiveHazards, RadiiEndAtShadowEdges) {
  const auto radii = radii_of(from_study("edge"), "fppm", 6, {}, 1024);
  for (const std::uint32_t pixels : {2U, 3U, 4U}) {
    // The bright side, which is to the left of the middle.
    const std::uint32_t column = 12 - pixels;
    const double distance = (pixels - 0.5) / 6, radius = median_of(radii, column, column + 1);
    std::printf("edge: radius at distance %.2f: %.2f\n", distance, radius);
    EXPECT_GT(radius, 0.5 * distance);
    EXPECT_LT(radius, 1.5 * distance);
  }
  EXPECT_GT(median_of(radii, 0, 4), 1.5 * median_of(radii, 10, 11));
}

// Claim: discs that reach through a thin wall shrink: no light leaks into the dim room for long.
TEST(AdaptiveHazards, DiscsDoNotReachThroughWalls) {
  // A wall over x = 0, a bright light to its left, a dim one to its right; both are parallel to the wall and
  // too close to it for the rest of the floor to matter.
  const std::string things =
      "<shape type=\"rectangle\"><bsdf type=\"diffuse\"/></shape>"
      "<shape type=\"cube\"><transform name=\"to_world\"><scale x=\"0.002\" y=\"2\" z=\"0.5\"/><translate "
      "x=\"0\" y=\"0\" z=\"0.5\"/></transform><bsdf type=\"diffuse\"/></shape>"
      "<emitter type=\"point\"><point name=\"position\" x=\"-0.6\" y=\"0\" z=\"0.9\"/><rgb "
      "name=\"intensity\" "
      "value=\"9\"/></emitter>"
      "<emitter type=\"point\"><point name=\"position\" x=\"0.6\" y=\"0\" z=\"0.9\"/><rgb name=\"intensity\" "
      "value=\"1\"/></emitter>";
  const auto radii = radii_of(from_above(things), "fppm", 4);
  std::printf("wall: median radius beside it %.2f, far from it in the dim room %.2f\n",
              median_of(radii, 12, 13), median_of(radii, 18, 22));
  EXPECT_LT(median_of(radii, 12, 13), 0.5);
  EXPECT_LT(median_of(radii, 13, 14), 0.7);
  EXPECT_GT(median_of(radii, 18, 22), 1.5 * median_of(radii, 12, 13));
}

// Claim: at a corner of two walls the disc sees photons on both, which are not even in its plane: radii
// shrink to what the wall leaves, and are as elsewhere farther away.
TEST(AdaptiveHazards, CornersShrink) {
  // A wall stands on the floor at x = 0 and faces +x; the light comes from there.
  const std::string things =
      "<shape type=\"rectangle\"><bsdf type=\"diffuse\"/></shape>"
      "<shape type=\"rectangle\"><transform name=\"to_world\"><rotate y=\"1\" "
      "angle=\"90\"/></transform><bsdf type=\"diffuse\"/></shape>"
      "<emitter type=\"directional\"><vector name=\"direction\" x=\"-0.5\" y=\"0\" z=\"-1\"/></emitter>";
  const auto radii = radii_of(from_above(things), "fppm", 4, {{"light_paths", "2"}});
  std::printf("corner: median radius beside it %.2f, far from it %.2f\n", median_of(radii, 12, 13),
              median_of(radii, 18, 22));
  EXPECT_LT(median_of(radii, 12, 13), 0.7);
  EXPECT_EQ(median_of(radii, 18, 22), 1);
}

// Claim: a dark spot of an eighth of the disc is not seen.
TEST(AdaptiveHazards, SmallSpotsAreNotSeen) {
  const auto at_spots = [](const std::vector<double>& radii) {
    double sum = 0;
    int spots = 0;
    for (std::uint32_t row = 0; row < kSide; ++row)
      for (std::uint32_t column = 0; column < kSide; ++column) {
        if ((row % 12 != 2 && row % 12 != 9) || (column % 12 != 2 && column % 12 != 9)) continue;
        sum += radii[row * kSide + column];
        ++spots;
      }
    return sum / spots;
  };
  const double sectors = at_spots(radii_of(from_study("dip"), "fppm", 4));
  std::printf("spots: mean radius %.2f\n", sectors);
  EXPECT_GT(sectors, 0.7);
}

}  // namespace
}  // namespace candela::statistical
