// Claims: a draw of direct light says whether it was sampled, dark or failed, and a dark one has the density
// that is asked for; all techniques of direct light say the density they draw with; what does not fail makes
// up the integral of that density. False-alarm rate: comparisons of means are at 5 standard errors; seeds are
// fixed, so that a test that passes keeps passing.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "tests/unit/light_cases.h"
#include "worker/core/math.h"
#include "worker/scene/emitters/choice/power.h"
#include "worker/scene/emitters/choice/uniform.h"
#include "worker/scene/emitters/lights.h"

namespace candela::scene {
namespace {

using test::build_scene;
using test::Draws;
using test::light_cases;
using test::light_files;
using test::LightCase;
using test::matrix;
using test::Mean;
using test::point_reference;
using test::uniform_direction;

const std::string kLampFacingDown = "<shape type=\"rectangle\">" +
                                    matrix({0.5, 0, 0, 0, 0, -0.5, 0, 0, 0, 0, -1, 2, 0, 0, 0, 1}) +
                                    "<emitter type=\"area\"/></shape>";
// Half of it emits nothing.
const std::string kHalfBlackLamp =
    "<shape type=\"rectangle\">" + matrix({0.5, 0, 0, 0, 0, -0.5, 0, 0, 0, 0, -1, 2, 0, 0, 0, 1}) +
    "<emitter type=\"area\"><texture name=\"radiance\" type=\"checkerboard\"><rgb name=\"color0\" "
    "value=\"0\"/><rgb name=\"color1\" value=\"1\"/></texture></emitter></shape>";
const std::string kSpotFacingDown =
    "<emitter type=\"spot\"><transform name=\"to_world\"><lookat origin=\"0,0,2\" target=\"0,0,0\" "
    "up=\"0,1,0\"/></transform><float name=\"cutoff_angle\" value=\"20\"/></emitter>";
const std::string kPointLamp =
    "<emitter type=\"point\"><point name=\"position\" x=\"0\" y=\"0\" z=\"2\"/></emitter>";

// The density that a technique states for the direction of `light`, by the point alone.
float stated_density(const Lights& lights, LightTechnique technique, PointSampler point,
                     const SurfaceHit& reference, Vec3 front, const DirectSample& light) {
  if (light.delta) return lights.prob(reference.p, front, light.emitter, technique);
  if (light.infinite) return lights.pdf_environment_solid_angle(reference, front, light.wi, technique);
  SurfaceHit hit;
  hit.p = light.p;
  hit.ng = light.ng;
  hit.emitter = light.emitter;
  hit.primitive = light.primitive;
  if (point == PointSampler::own) return lights.pdf_solid_angle(reference, front, light.wi, hit, technique);
  return lights.pdf_point_solid_angle(reference, front, light.wi, hit, point) *
         lights.prob(reference.p, front, light.emitter, technique);
}

struct Case {
  const char* name;
  std::string body;
  Vec3 reference, front;
  DirectOutcome outcome;
};

// Claim: below the horizon and outside of a spot's cone a draw is dark; behind a lamp, at a point light and
// without emitters it fails.
TEST(DirectOutcomes, AreToldApart) {
  const Vec3 up{0, 0, 1}, down{0, 0, -1}, both{};
  const Case cases[] = {
      {"lamp", kLampFacingDown, {0, 0, 0}, up, DirectOutcome::sampled},
      {"lamp, either side", kLampFacingDown, {0, 0, 0}, both, DirectOutcome::sampled},
      {"lamp below the horizon", kLampFacingDown, {0, 0, 0}, down, DirectOutcome::dark},
      {"behind the lamp", kLampFacingDown, {0, 0, 3}, both, DirectOutcome::failed},
      {"point", kPointLamp, {0, 0, 0}, up, DirectOutcome::sampled},
      {"point below the horizon", kPointLamp, {0, 0, 0}, down, DirectOutcome::dark},
      {"at the point", kPointLamp, {0, 0, 2}, both, DirectOutcome::failed},
      {"spot", kSpotFacingDown, {0, 0, 0}, up, DirectOutcome::sampled},
      {"beside the spot's cone", kSpotFacingDown, {3, 0, 0}, up, DirectOutcome::dark},
      {"sky", "<emitter type=\"constant\"/>", {0, 0, 0}, {0, 1, 0}, DirectOutcome::sampled},
      // A constant sky is sampled on the front's side alone.
      {"sky, the other side", "<emitter type=\"constant\"/>", {0, 0, 0}, {0, -1, 0}, DirectOutcome::sampled},
      {"no emitter", "", {0, 0, 0}, up, DirectOutcome::failed},
  };
  for (const Case& c : cases) {
    auto scene = build_scene(c.body);
    ASSERT_TRUE(scene.ok()) << c.name << ": " << scene.error().to_string();
    const SurfaceHit reference = point_reference(c.reference);
    DirectSample light;
    EXPECT_EQ((*scene)->sample_direct(reference, c.front, 0.5f, {0.25f, 0.4f}, light), c.outcome) << c.name;
    if (c.outcome != DirectOutcome::dark) continue;
    EXPECT_TRUE(light.radiance.is_black()) << c.name;
    EXPECT_GT(light.pdf_solid_angle, 0) << c.name;
    EXPECT_NEAR(length(light.wi), 1, 1e-5f) << c.name;
  }
}

// Claim: a constant sky is sampled by the cosine where the reference has a front: the density is the stated
// one, and the cosine over it is pi, so that a diffuse surface has no noise from an open sky.
TEST(DirectOutcomes, AConstantSkyIsSampledByTheCosine) {
  auto scene = build_scene("<emitter type=\"constant\"/>");
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  Draws draws(31, 2);
  const Vec3 front = normalize(Vec3{1, 2, -0.5f});
  const SurfaceHit reference = point_reference({0, 0, 0});
  for (int i = 0; i < 1000; ++i) {
    DirectSample light;
    ASSERT_EQ((*scene)->sample_direct(reference, front, draws.next(), draws.next_2d(), light),
              DirectOutcome::sampled);
    EXPECT_EQ((*scene)->pdf_direct_environment_solid_angle(reference, front, light.wi),
              light.pdf_solid_angle);
    EXPECT_NEAR(dot(front, light.wi) / light.pdf_solid_angle, math::kPi, 1e-4f);
  }
}

// Claim: beside a lamp that gives as much, a constant sky gets next to no shadow ray, since scattered rays
// find it; where the lamp cannot shine it gets all of them.
TEST(DirectOutcomes, ASmoothSkyLeavesTheRayToTheLamp) {
  // Irradiance pi from either.
  const std::string lamp =
      "<emitter type=\"directional\"><vector name=\"direction\" x=\"0\" y=\"0\" z=\"-1\"/>"
      "<rgb name=\"irradiance\" value=\"3.14159 3.14159 3.14159\"/></emitter>";
  auto scene = build_scene(lamp + "<emitter type=\"constant\"/>");
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  const SurfaceHit reference = point_reference({0, 0, 0});
  const auto sky_share = [&](Vec3 front) {
    const Vec3 d = normalize(front + Vec3{0.1f, 0.2f, 0});
    return (*scene)->pdf_direct_environment_solid_angle(reference, front, d) * math::kPi / dot(d, front);
  };
  EXPECT_LT(sky_share({0, 0, 1}), 0.05f);
  EXPECT_GT(sky_share({0, 0, 1}), 0.01f);
  EXPECT_NEAR(sky_share({0, 0, -1}), 1, 1e-5f);
}

// Claim: a black texel makes a draw dark, not failed.
TEST(DirectOutcomes, ABlackTexelIsDark) {
  auto scene = build_scene(kHalfBlackLamp);
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  Draws draws(31, 1);
  std::array<int, 3> counts{};
  const int n = 2000;
  for (int i = 0; i < n; ++i) {
    DirectSample light;
    const float u = draws.next();
    const auto outcome =
        (*scene)->sample_direct(point_reference({0.1f, 0, 0}), {0, 0, 1}, u, draws.next_2d(), light);
    ++counts[static_cast<std::size_t>(outcome)];
    EXPECT_EQ(light.radiance.is_black(), outcome == DirectOutcome::dark);
  }
  EXPECT_EQ(counts[static_cast<std::size_t>(DirectOutcome::failed)], 0);
  EXPECT_GT(counts[static_cast<std::size_t>(DirectOutcome::sampled)], n / 3);
  EXPECT_GT(counts[static_cast<std::size_t>(DirectOutcome::dark)], n / 3);
}

// Claim: whatever does not fail, dark or not, has the density that its technique states for the direction; of
// all kinds of emitters, few (importance) and many (tree).
TEST(DirectOutcomes, HaveTheStatedDensityInEveryTechnique) {
  std::string few;
  for (const LightCase& light : light_cases())
    if (light.name != "constant") few += light.body;  // one environment a scene: the envmap
  std::string many = few;
  for (int i = 0; i < 60; ++i)
    many += fmt::format(
        "<shape type=\"sphere\"><point name=\"center\" x=\"{}\" y=\"3\" z=\"1\"/><float name=\"radius\" "
        "value=\"0.05\"/><emitter type=\"area\"/></shape>",
        0.2 * i - 6);
  for (const std::string& body : {few, many}) {
    auto scene = build_scene(body, light_files());
    ASSERT_TRUE(scene.ok()) << scene.error().to_string();
    const Lights& lights = (*scene)->lights();
    constexpr PointSampler kPoints[] = {PointSampler::own, PointSampler::spherical, PointSampler::area,
                                        PointSampler::parallel};
    for (int i = 0; i < 12; ++i) {
      const LightTechnique technique = kLightTechniques[i / 4];
      const PointSampler point = kPoints[i % 4];
      Draws draws(31, 2);
      std::array<int, 3> counts{};
      for (int k = 0; k < 20000; ++k) {
        const SurfaceHit reference = point_reference({0.3f, -0.4f, 0.2f});
        const Vec3 front = k % 2 == 0 ? Vec3{} : normalize(Vec3{1, 0.5f, 0.3f});
        DirectSample light;
        const float u = draws.next();
        const auto outcome = lights.sample(reference, front, u, draws.next_2d(), light, technique, point);
        ++counts[static_cast<std::size_t>(outcome)];
        if (outcome == DirectOutcome::failed) continue;
        const float stated = stated_density(lights, technique, point, reference, front, light);
        ASSERT_NEAR(stated / light.pdf_solid_angle, 1, 2e-3f)
            << "technique " << i << ", emitter " << light.emitter;
      }
      for (const int count : counts) EXPECT_GT(count, 0) << "technique " << i;
    }
  }
}

// Claim: draws that are sampled or dark make up the integral of the stated density over directions; the rest
// of them failed. A cube below the horizon in part: some of its faces are seen from behind.
TEST(DirectOutcomes, FailuresAreWhatTheDensityLacks) {
  auto scene = build_scene("<shape type=\"cube\">" +
                           matrix({0.4, 0, 0.3, 0, 0, 0.5, 0, 0.1, 0.3, 0, -0.4, 2, 0, 0, 0, 1}) +
                           "<emitter type=\"area\"/></shape>");
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  const SurfaceHit reference = point_reference({0.3f, -0.4f, 0.2f});
  const Vec3 front = normalize(Vec3{1, 0.5f, 0.1f});
  Draws draws(31, 3);
  Mean drawn, dark, density;
  for (int i = 0; i < 100000; ++i) {
    DirectSample light;
    const float u = draws.next();
    const auto outcome = (*scene)->sample_direct(reference, front, u, draws.next_2d(), light);
    drawn.add(outcome != DirectOutcome::failed ? 1 : 0);
    dark.add(outcome == DirectOutcome::dark ? 1 : 0);
  }
  for (int i = 0; i < 400000; ++i) {
    const Vec3 d = uniform_direction(draws.stream);
    SurfaceHit hit;
    double pdf = 0;
    if ((*scene)->intersect({reference.p, d}, hit))
      pdf = static_cast<double>((*scene)->pdf_direct_solid_angle(reference, front, d, hit));
    density.add(4 * std::numbers::pi * pdf);
  }
  EXPECT_GT(dark.mean(), 0.01);
  EXPECT_LT(drawn.mean(), 0.99);
  EXPECT_NEAR(drawn.mean(), density.mean(), 5 * std::hypot(drawn.error(), density.error()));
}

// Claim: the choosers that know no reference choose as they say, and leave a number that is uniform again.
TEST(EmitterChoosers, OfPowerAndEvenChooseAsTheySay) {
  const std::vector<double> powers = {1, 0, 5, 2};
  const PowerChooser by_power(powers);
  const UniformChooser evenly(powers.size());
  const auto check = [&](const auto& chooser, const std::vector<double>& expected) {
    constexpr int kSteps = 8000;
    std::vector<int> counts(expected.size());
    double rest = 0;
    for (int i = 0; i < kSteps; ++i) {
      EmitterChoice choice;
      ASSERT_TRUE(chooser.choose({}, {}, (i + 0.5) / kSteps, choice));
      ASSERT_LT(choice.emitter, counts.size());
      ASSERT_EQ(choice.prob, chooser.prob({}, {}, choice.emitter));
      ASSERT_TRUE(choice.rest >= 0 && choice.rest < 1);
      ++counts[choice.emitter];
      rest += choice.rest / kSteps;
    }
    for (std::uint32_t i = 0; i < expected.size(); ++i) {
      EXPECT_NEAR(counts[i], expected[i] * kSteps, 1) << i;
      EXPECT_FLOAT_EQ(chooser.prob({}, {}, i), static_cast<float>(expected[i])) << i;
    }
    EXPECT_NEAR(rest, 0.5, 1e-3);
    EmitterChoice last;
    ASSERT_TRUE(chooser.choose({}, {}, 1 - 0x1p-53, last));
    EXPECT_EQ(last.emitter, expected.size() - 1);
  };
  check(by_power, {0.125, 0, 0.625, 0.25});
  check(evenly, {0.25, 0.25, 0.25, 0.25});
  EmitterChoice none;
  EXPECT_FALSE(PowerChooser({0, 0}).choose({}, {}, 0.5, none));
  EXPECT_FALSE(UniformChooser(0).choose({}, {}, 0.5, none));
}

}  // namespace
}  // namespace candela::scene
