// Claims: what sample_direct draws has the density pdf_direct says (checked from the other side, by
// directions drawn uniformly and traced); irradiance by sampling is that of closed forms; the choice among
// emitters is consistent and never leaves out one that matters. False-alarm rate: each comparison of means is
// at 5 standard errors, about 6e-7 two-sided; seeds are fixed, so that a test that passes keeps passing.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>

#include "tests/statistical/moments.h"
#include "tests/unit/scene_fixture.h"

namespace candela::scene {
namespace {

using test::build_scene;
using test::matrix;
using test::point_reference;
using test::uniform_direction;

using Mean = statistical::Moments;

const std::string kRectangleLamp =
    "<shape type=\"rectangle\">" + matrix({0.5, 0, 0, 0.2, 0, -0.8, 0, 0.1, 0, 0, -1, 1, 0, 0, 0, 1}) +
    "<emitter type=\"area\"><rgb name=\"radiance\" value=\"2\"/></emitter></shape>";
const std::string kShearedLamp = "<shape type=\"rectangle\">" +
                                 matrix({0.5, 0.4, 0, 0.2, 0, -0.8, 0, 0.1, 0, 0, -1, 1, 0, 0, 0, 1}) +
                                 "<emitter type=\"area\"/></shape>";
const std::string kSphereLamp =
    "<shape type=\"sphere\"><point name=\"center\" x=\"0.3\" y=\"-0.2\" z=\"1\"/>"
    "<float name=\"radius\" value=\"0.4\"/><emitter type=\"area\"/></shape>";
const std::string kCubeLamp = "<shape type=\"cube\">" +
                              matrix({0.2, 0, 0.1, 0.2, 0, 0.3, 0, 0.1, -0.1, 0, 0.2, 1, 0, 0, 0, 1}) +
                              "<emitter type=\"area\"/></shape>";
const std::string kInsideOut =
    "<shape type=\"sphere\"><float name=\"radius\" value=\"3\"/>"
    "<boolean name=\"flip_normals\" value=\"true\"/><emitter type=\"area\"/></shape>";

// For any test function f over directions: the mean of f / pdf over samples is the integral of f over what is
// visible and emits; the integral again by uniform directions; and the density integrates to 1. All three
// agree.
void check_density(const std::string& body, Vec3 reference, Vec3 front, std::uint64_t seed) {
  auto built = build_scene(body);
  ASSERT_TRUE(built.ok()) << built.error().to_string();
  const Scene& scene = **built;
  rng::Stream stream(rng::key(2, seed));
  const SurfaceHit ref = point_reference(reference);
  const auto f = [](Vec3 d) { return 1.3 + static_cast<double>(d.x) + 0.5 * static_cast<double>(d.y * d.y); };
  Mean by_light, by_sphere, density;
  for (int i = 0; i < 60000; ++i) {
    DirectSample light;
    const float a = stream.next_float(), b = stream.next_float();
    double value = 0;
    if (scene.sample_direct(ref, front, a, {b, stream.next_float()}, light) == DirectOutcome::sampled) {
      ASSERT_GT(light.pdf_solid_angle, 0);
      ASSERT_NEAR(length(light.wi), 1, 1e-5f);
      // A ray finds what the sample found, and its density is that of the other technique.
      SurfaceHit hit;
      if (scene.intersect({reference, light.wi}, hit) && hit.emitter == light.emitter &&
          dot(hit.ng, light.wi) < -1e-3f) {
        const float pdf = scene.pdf_direct_solid_angle(ref, front, light.wi, hit);
        ASSERT_NEAR(pdf / light.pdf_solid_angle, 1, 2e-3f);
      }
      if (!scene.occluded(light.shadow_ray)) value = f(light.wi) / static_cast<double>(light.pdf_solid_angle);
    }
    by_light.add(value);
  }
  for (int i = 0; i < 400000; ++i) {
    const Vec3 d = uniform_direction(stream);
    SurfaceHit hit;
    double value = 0, pdf = 0;
    if (scene.intersect({reference, d}, hit) && !scene.emitted(hit, -d).is_black() &&
        (length_squared(front) == 0 || dot(front, d) > 0)) {
      value = f(d);
      pdf = static_cast<double>(scene.pdf_direct_solid_angle(ref, front, d, hit));
    }
    by_sphere.add(4 * std::numbers::pi * value);
    density.add(4 * std::numbers::pi * pdf);
  }
  EXPECT_NEAR(by_light.mean(), by_sphere.mean(), 5 * std::hypot(by_light.error(), by_sphere.error()) + 1e-9);
  // Less than 1 where part of the light faces away, lies below the horizon or is hidden.
  EXPECT_LE(density.mean(), 1 + 5 * density.error());
}

TEST(LightSampling, DensitiesAreThoseOfTheSamples) {
  const Vec3 none{};
  check_density(kRectangleLamp, {0, 0, 0}, none, 1);
  check_density(kRectangleLamp, {0.3f, 0.2f, 0.9f}, none, 2);   // close below
  check_density(kRectangleLamp, {1.5f, 1.5f, 0.95f}, none, 3);  // grazing
  check_density(kRectangleLamp, {0, 0, -9}, none, 4);           // sampled by area
  check_density(kShearedLamp, {0, 0, 0}, none, 5);
  check_density(kSphereLamp, {0, 0, 0}, none, 6);
  check_density(kSphereLamp, {0.3f, -0.2f, 0.595f}, none, 7);  // almost touching
  check_density(kSphereLamp, {0.3f, -0.2f, -30}, none, 8);
  check_density(kInsideOut, {0.5f, 1, -2}, none, 9);
  check_density(kCubeLamp, {0, 0, 0}, none, 10);
  const std::string all = kRectangleLamp + kSphereLamp + kCubeLamp + kInsideOut + kShearedLamp;
  check_density(all, {0, 0, 0}, none, 11);
  check_density(all, {-0.5f, 0.4f, 0.3f}, normalize(Vec3{1, 2, -1}), 12);
  check_density(all, {1.2f, 0.9f, 1.2f}, normalize(Vec3{-1, 0, -0.1f}), 13);
  std::string crowd;  // beyond the limit of importance: by power
  for (int i = 0; i < 80; ++i) {
    crowd += fmt::format(
        "<shape type=\"sphere\"><point name=\"center\" x=\"{}\" y=\"{}\" z=\"1\"/><float name=\"radius\" "
        "value=\"0.08\"/>"
        "<emitter type=\"area\"><rgb name=\"radiance\" value=\"{}\"/></emitter></shape>",
        (i % 9) * 0.25 - 1, (i / 9) * 0.25 - 1, 1 + i % 5);
  }
  check_density(crowd, {0, 0, 0}, none, 14);
}

// The density of a light wholly visible from the front integrates to 1.
TEST(LightSampling, DensitiesIntegrateToOne) {
  for (const std::string& body : {kRectangleLamp, kSphereLamp, kShearedLamp}) {
    auto scene = build_scene(body);
    ASSERT_TRUE(scene.ok());
    rng::Stream stream(rng::key(2, 90));
    Mean density;
    for (int i = 0; i < 500000; ++i) {
      const Vec3 d = uniform_direction(stream);
      SurfaceHit hit;
      double pdf = 0;
      if ((*scene)->intersect({{0, 0, 0}, d}, hit)) {
        pdf = static_cast<double>((*scene)->pdf_direct_solid_angle(point_reference({0, 0, 0}), {}, d, hit));
      }
      density.add(4 * std::numbers::pi * pdf);
    }
    EXPECT_NEAR(density.mean(), 1, 5 * density.error());
  }
}

void expect_irradiance(const Scene& scene, Vec3 p, int n, double expected, double tolerance = 1e-5) {
  const SurfaceHit ref = point_reference(p);
  rng::Stream stream(rng::key(2, 91));
  Mean mean;
  for (int i = 0; i < n; ++i) {
    DirectSample light;
    const float a = stream.next_float(), b = stream.next_float();
    double value = 0;
    if (scene.sample_direct(ref, ref.ng, a, {b, stream.next_float()}, light) == DirectOutcome::sampled) {
      value = static_cast<double>(light.radiance.g * std::max(0.0f, dot(ref.ng, light.wi)) /
                                  light.pdf_solid_angle);
    }
    mean.add(value);
  }
  EXPECT_NEAR(mean.mean(), expected, 5 * mean.error() + tolerance * expected)
      << p.x << " " << p.y << " " << p.z;
}

// A rectangle of sides a, b at height h whose corner is over the point [Howell, configuration factor B-4],
// four of them with signs; a sphere at distance d: E = pi L sin^2 (wholly above the horizon); point and
// directional by definition.
TEST(LightSampling, IrradianceIsThatOfClosedForms) {
  const auto corner = [](double a, double b, double h) {
    const double x = a / h, y = b / h;
    return (x / std::sqrt(1 + x * x) * std::atan(y / std::sqrt(1 + x * x)) +
            y / std::sqrt(1 + y * y) * std::atan(x / std::sqrt(1 + y * y))) /
           2;
  };
  {
    auto scene = build_scene(kRectangleLamp);  // [-0.3, 0.7] x [-0.7, 0.9] at z = 1, radiance 2
    for (const Vec3 p : {Vec3{0, 0, 0}, Vec3{2, 0, 0.5f}, Vec3{0.1f, 0.3f, 0.95f}, Vec3{0, 0, -20}}) {
      const double h = 1 - static_cast<double>(p.z), x0 = -0.3 - static_cast<double>(p.x), x1 = x0 + 1,
                   y0 = -0.7 - static_cast<double>(p.y), y1 = y0 + 1.6;
      const double expected =
          2 * (corner(x1, y1, h) - corner(x0, y1, h) - corner(x1, y0, h) + corner(x0, y0, h));
      expect_irradiance(**scene, p, 100000, expected);
    }
  }
  for (const double d : {0.51, 2.0, 1e3}) {
    auto scene =
        build_scene(fmt::format("<shape type=\"sphere\"><point name=\"center\" x=\"0\" y=\"0\" z=\"{}\"/>"
                                "<float name=\"radius\" value=\"0.5\"/><emitter type=\"area\"/></shape>",
                                d));
    const double expected = std::numbers::pi * 0.25 / (d * d);
    expect_irradiance(**scene, {0, 0, 0}, 100000, expected);
  }
  auto point = build_scene(
      "<emitter type=\"point\"><point name=\"position\" x=\"0\" y=\"3\" z=\"4\"/>"
      "<rgb name=\"intensity\" value=\"50\"/></emitter>");
  expect_irradiance(**point, {0, 0, 0}, 10, 50.0 / 25 * 0.8);
  auto sun = build_scene(
      "<emitter type=\"directional\"><vector name=\"direction\" x=\"0\" y=\"-3\" z=\"-4\"/>"
      "<rgb name=\"irradiance\" value=\"10\"/></emitter>");
  expect_irradiance(**sun, {0, 0, 0}, 10, 8);
  auto sky = build_scene("<emitter type=\"constant\"><rgb name=\"radiance\" value=\"3\"/></emitter>");
  expect_irradiance(**sky, {0, 0, 0}, 100000, 3 * std::numbers::pi);
  // All together: the choice among kinds keeps the sum.
  auto mixed = build_scene(
      kRectangleLamp +
      "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"3\"/></emitter>"
      "<emitter type=\"directional\"><vector name=\"direction\" x=\"0\" y=\"-3\" z=\"-4\"/>"
      "<rgb name=\"irradiance\" value=\"10\"/></emitter><emitter type=\"point\">"
      "<point name=\"position\" x=\"0\" y=\"3\" z=\"4\"/><rgb name=\"intensity\" value=\"50\"/></emitter>");
  const double rectangle =
      2 * (corner(0.7, 0.9, 1) - corner(-0.3, 0.9, 1) - corner(0.7, -0.7, 1) + corner(-0.3, -0.7, 1));
  expect_irradiance(**mixed, {0, 0, 0}, 200000, rectangle + 3 * std::numbers::pi + 8 + 1.6);
}

// Emission is from the front alone, whatever the bsdf; lights behind the surface are left out.
TEST(LightSampling, EmissionIsOneSided) {
  auto scene = build_scene(kRectangleLamp);
  SurfaceHit hit;
  ASSERT_TRUE((*scene)->intersect({{0.2f, 0.1f, 0}, {0, 0, 1}}, hit));
  EXPECT_EQ((*scene)->emitted(hit, {0, 0, -1}).g, 2.0f);
  EXPECT_TRUE((*scene)->emitted(hit, {0, 0, 1}).is_black());
  DirectSample light;
  EXPECT_NE((*scene)->sample_direct(point_reference({0, 0, 2}), {}, 0.5f, {0.5f, 0.5f}, light),
            DirectOutcome::sampled);
  EXPECT_NE((*scene)->sample_direct(point_reference({0, 0, 0}), {0, 0, -1}, 0.5f, {0.5f, 0.5f}, light),
            DirectOutcome::sampled);
  EXPECT_EQ((*scene)->sample_direct(point_reference({0, 0, 0}), {0, 0, 1}, 0.5f, {0.5f, 0.5f}, light),
            DirectOutcome::sampled);
}

// Extreme sizes and distances give finite samples whose estimate is right.
TEST(LightSampling, SurvivesExtremes) {
  for (const double d : {1e-2, 1.0, 1e4, 1e8}) {
    for (const double r : {1e-6, 1e-3, 0.3}) {
      auto scene =
          build_scene(fmt::format("<shape type=\"sphere\"><point name=\"center\" x=\"0\" y=\"0\" "
                                  "z=\"{}\"/><float name=\"radius\" value=\"{}\"/>"
                                  "<emitter type=\"area\"/></shape>",
                                  d, r * d));
      ASSERT_TRUE(scene.ok());
      const double expected = std::numbers::pi * r * r;
      expect_irradiance(**scene, {0, 0, 0}, 1000, expected, 1e-4);
    }
  }
}

}  // namespace
}  // namespace candela::scene
