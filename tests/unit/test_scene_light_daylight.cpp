// The sky and the sun: what no choice of resolution may change. (test_scene_sky.cpp has the sky's radiance.)
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/unit/scene_fixture.h"

namespace candela::scene {
namespace {

using test::build_scene;

std::unique_ptr<Scene> daylight(const std::string& plugin, const std::string& parameters) {
  auto scene = build_scene("<emitter type='" + plugin + "'>" + parameters + "</emitter>");
  EXPECT_TRUE(scene.ok()) << (scene.ok() ? "" : scene.error().to_string());
  return scene.ok() ? std::move(scene).value() : nullptr;
}

std::string number_of(const std::string& name, double value) {
  return fmt::format("<float name='{}' value='{}'/>", name, value);
}

// Towards the sun at an elevation in degrees, in the plane of x and y.
std::string sun_at(double elevation) {
  const double a = elevation * std::numbers::pi / 180;
  return fmt::format("<vector name='sun_direction' x='{}' y='{}' z='0'/>", std::cos(a), std::sin(a));
}

Vec3 towards(double elevation, double azimuth) {
  const double a = elevation * std::numbers::pi / 180, b = azimuth * std::numbers::pi / 180;
  return {static_cast<float>(std::cos(a) * std::cos(b)), static_cast<float>(std::sin(a)),
          static_cast<float>(std::cos(a) * std::sin(b))};
}

// The integral of radiance over the sphere, by importance sampling.
Spectrum power_of(const Scene& scene) {
  rng::Stream stream(rng::key(19, 1));
  SurfaceHit reference = test::point_reference({0, 0, 0});
  Vec3d sum;
  constexpr int kSamples = 20000;
  for (int i = 0; i < kSamples; ++i) {
    DirectSample light;
    const float a = stream.next_float(), b = stream.next_float(), c = stream.next_float();
    if (scene.sample_direct(reference, {}, a, {b, c}, light) != DirectOutcome::sampled) continue;
    const double inverse = 1 / static_cast<double>(light.pdf_solid_angle);
    sum += Vec3d{light.radiance.r * inverse, light.radiance.g * inverse, light.radiance.b * inverse};
  }
  const Vec3d mean = sum / kSamples;
  return {static_cast<float>(mean.x), static_cast<float>(mean.y), static_cast<float>(mean.z)};
}

// Claim: the sky is symmetric about the sun's meridian, brighter near the sun, blue far from it, and dark
// below the horizon unless it is stretched.
TEST(Daylight, SkyHasItsShape) {
  const auto scene = daylight("sky", sun_at(40));
  ASSERT_NE(scene, nullptr);
  for (const double elevation : {5.0, 30.0, 70.0})
    for (const double azimuth : {20.0, 90.0, 150.0}) {
      const Spectrum left = scene->environment(towards(elevation, azimuth));
      const Spectrum right = scene->environment(towards(elevation, -azimuth));
      EXPECT_NEAR(left.g, right.g, 0.01f * left.g) << elevation << " " << azimuth;
    }
  EXPECT_GT(scene->environment(towards(40, 10)).g, 2 * scene->environment(towards(40, 180)).g);
  const Spectrum away = scene->environment(towards(60, 180));
  EXPECT_GT(away.b, 1.5f * away.r);
  EXPECT_EQ(luminance(scene->environment(towards(-20, 0))), 0.0f);
  const auto stretched = daylight("sky", sun_at(40) + number_of("stretch", 2));
  EXPECT_GT(luminance(stretched->environment(towards(-20, 0))), 0.0f);
}

// Claim: the sun's power depends neither on the image's resolution nor on how wide the sun is; it falls and
// reddens with turbidity, and the sum of sky and sun is theirs.
TEST(Daylight, SunKeepsItsPower) {
  const auto power = [](const std::string& parameters) {
    const auto scene = daylight("sun", sun_at(35) + parameters);
    return scene == nullptr ? Spectrum() : power_of(*scene);
  };
  const Spectrum sun = power("");
  ASSERT_GT(sun.g, 0.0f);
  for (const std::string& other : {std::string("<integer name='resolution' value='128'/>"),
                                   std::string("<integer name='resolution' value='2048'/>"),
                                   number_of("sun_radius_scale", 12), number_of("sun_radius_scale", 0)})
    EXPECT_NEAR(power(other).g, sun.g, 0.015f * sun.g) << other;
  // Mitsuba 3's width of the sun, in degrees, is that of 12 suns.
  const auto power_of_both = [](const std::string& parameters) {
    const auto scene = daylight("sunsky", sun_at(35) + parameters);
    return scene == nullptr ? Spectrum() : power_of(*scene);
  };
  EXPECT_EQ(power_of_both(number_of("sun_aperture", 12 * 0.5358)).g,
            power_of_both(number_of("sun_radius_scale", 12)).g);
  EXPECT_NE(power_of_both(number_of("sun_aperture", 12 * 0.5358)).g, power_of_both("").g);
  EXPECT_NEAR(power(number_of("scale", 3)).g, 3 * sun.g, 0.03f * sun.g);
  // About 1000 W / m^2 in 400 to 700 nm and beyond reach the ground on a clear day: some 1.3 per nm.
  EXPECT_GT(sun.g, 0.7f);
  EXPECT_LT(sun.g, 1.9f);
  const Spectrum hazy = power(number_of("turbidity", 8));
  EXPECT_LT(hazy.g, 0.8f * sun.g);
  EXPECT_GT(hazy.r / hazy.b, 1.2f * sun.r / sun.b);
  const auto sky = daylight("sky", sun_at(35)), both = daylight("sunsky", sun_at(35));
  EXPECT_NEAR(power_of(*both).g, power_of(*sky).g + sun.g, 0.03f * sun.g);
}

// Claim: light is drawn from the sky in proportion to its radiance: the integral over the sphere by
// importance sampling is that by a quadrature.
TEST(Daylight, SamplesFollowTheSky) {
  const auto scene = daylight("sky", number_of("turbidity", 6) + sun_at(12));
  ASSERT_NE(scene, nullptr);
  double sum = 0;
  constexpr int kRows = 720;
  for (int i = 0; i < kRows; ++i)
    for (int j = 0; j < 2 * kRows; ++j) {
      const double theta = (i + 0.5) * std::numbers::pi / kRows;
      sum +=
          static_cast<double>(
              scene->environment(towards(90 - theta * 180 / std::numbers::pi, (j + 0.5) * 180.0 / kRows)).g) *
          std::sin(theta);
    }
  sum *= (std::numbers::pi / kRows) * (std::numbers::pi / kRows);
  EXPECT_NEAR(power_of(*scene).g / sum, 1, 0.002);
}

// Claim: the sun is 0.5358 degrees wide, as in Mitsuba. Of a disk of 12 times that width and the same power,
// power over radiance is the solid angle.
TEST(Daylight, SunIsAsWideAsMitsubas) {
  const auto scene = daylight(
      "sun", sun_at(40) + number_of("sun_radius_scale", 12) + "<integer name='resolution' value='2048'/>");
  ASSERT_NE(scene, nullptr);
  double radiance = 0;
  int count = 0;
  for (int i = -20; i <= 20; ++i)
    for (int j = -20; j <= 20; ++j, ++count)
      radiance += static_cast<double>(
          scene->environment(towards(40 + i * 0.08, j * 0.08 / std::cos(40 * std::numbers::pi / 180))).g);
  radiance /= count;
  const double radius = 12 * 0.5358 / 2 * std::numbers::pi / 180;
  EXPECT_NEAR(static_cast<double>(power_of(*scene).g) / radiance / (std::numbers::pi * radius * radius), 1,
              0.004);
}

// Claim: the sun's direction is one of the scene: to_world turns the sky about it, and not the sun.
TEST(Daylight, DirectionOfTheSunIsOfTheScene) {
  const std::string turned =
      "<transform name='to_world'><rotate z='1' angle='30'/><rotate x='1' angle='20'/></transform>";
  const auto scene = daylight("sun", sun_at(60) + number_of("sun_radius_scale", 20) + turned);
  ASSERT_NE(scene, nullptr);
  EXPECT_GT(luminance(scene->environment(towards(60, 0))), 0.0f);
  for (const double azimuth : {90.0, 180.0, 270.0})
    EXPECT_EQ(luminance(scene->environment(towards(60, azimuth))), 0.0f) << azimuth;
}

// Claim: without a direction the sun stands where date, time and place put it: in Tokyo on July 10th 2010, at
// 15:00, 46.1 degrees high in the west (declination 22.3 degrees, solar time 15:13).
TEST(Daylight, SunFollowsTheClock) {
  const auto scene = daylight("sun", "");
  ASSERT_NE(scene, nullptr);
  Vec3 brightest;
  float most = 0;
  for (int i = 0; i < 360; ++i)
    for (int j = 0; j < 90; ++j) {
      const Vec3 d = towards(j, i);
      const float value = luminance(scene->environment(d));
      if (value > most) {
        most = value;
        brightest = d;
      }
    }
  ASSERT_GT(most, 0.0f);
  EXPECT_NEAR(std::asin(brightest.y) * 180 / std::numbers::pi, 46.1, 1.2);
  EXPECT_LT(brightest.x, -0.6f);  // west; east is +x
}

// Claim: a sun below the horizon gives no sky, and says so.
TEST(Daylight, NightIsRefused) {
  const auto scene = build_scene("<emitter type='sunsky'>" + sun_at(-5) + "</emitter>");
  ASSERT_FALSE(scene.ok());
  EXPECT_NE(scene.error().to_string().find("below the horizon"), std::string::npos);
}

}  // namespace
}  // namespace candela::scene
