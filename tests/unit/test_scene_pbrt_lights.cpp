// Claims: pbrt's lights whose pictures and powers are known where they are built: goniometric and projection
// lights, powers of area lights, the illuminance of a sky.
// One chi-squared test at 1e-6, five means at 7 standard errors and more: a false alarm over seeds, which are
// fixed, with less than 2e-6.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>

#include "common/rng/stream.h"
#include "tests/unit/chi_squared.h"
#include "tests/unit/light_cases.h"
#include "tests/unit/scene_fixture.h"
#include "worker/scene/emitters/equal_area.h"

namespace candela::scene {
namespace {

constexpr double kPi = std::numbers::pi;

// Rows from the top.
std::string pfm(int width, int height, const std::vector<float>& gray) {
  std::string text = "PF\n" + std::to_string(width) + " " + std::to_string(height) + "\n-1.0\n";
  for (int y = height - 1; y >= 0; --y)
    for (int x = 0; x < width; ++x)
      for (int c = 0; c < 3; ++c) {
        char bytes[4];
        std::memcpy(bytes, &gray[static_cast<std::size_t>(y * width + x)], 4);
        text.append(bytes, 4);
      }
  return text;
}

std::unique_ptr<Scene> built(const std::string& body, std::map<std::string, std::string> files = {}) {
  auto scene = test::build_scene(body, std::move(files));
  EXPECT_TRUE(scene.ok()) << (scene.ok() ? "" : scene.error().to_string());
  return scene.ok() ? std::move(scene).value() : nullptr;
}

const std::string kSpeck = "<shape type='sphere'><float name='radius' value='0.001'/></shape>";

// The intensity towards a direction, from the light at the origin.
double intensity(const Scene& scene, Vec3 d) {
  DirectSample out;
  const DirectOutcome outcome =
      scene.sample_direct(test::point_reference(d * 2.0f), {}, 0.5f, {0.5f, 0.5f}, out);
  return outcome == DirectOutcome::sampled ? 4 * static_cast<double>(out.radiance.g) : 0.0;
}

// Claim: the square and the sphere are each other's inverse.
TEST(EqualAreaInverse, GivesTheDirection) {
  rng::Stream stream(rng::key(12));
  for (int i = 0; i < 2000; ++i) {
    const Vec3d d = normalize(Vec3d(test::uniform_direction(stream)));
    const Vec2 uv = equal_area_square(d);
    const Vec3d back = equal_area_direction(static_cast<double>(uv.x), static_cast<double>(uv.y));
    EXPECT_NEAR(length(back - d), 0, 3e-6);
    EXPECT_NEAR(length(back), 1, 1e-12);
  }
  for (const Vec2 edge : {Vec2{0.5f, 0.5f}, Vec2{0, 0}, Vec2{1, 0.5f}, Vec2{0.5f, 1}})
    EXPECT_NEAR(length(equal_area_direction(static_cast<double>(edge.x), static_cast<double>(edge.y))), 1,
                1e-12);
}

// Claim: a goniometric light has the picture's value of each direction, +y in its middle and +z below, turned
// with to_world; light leaves with a density of the intensity, whose integral is the power, and in the
// directions of that density.
TEST(GoniometricLights, FollowTheirPicture) {
  constexpr int kSide = 8;
  std::vector<float> gray(kSide * kSide);
  for (int i = 0; i < kSide * kSide; ++i)
    gray[static_cast<std::size_t>(i)] = i % 5 == 0 ? 0.0f : 0.1f * static_cast<float>(i);
  const std::string light =
      "<emitter type='goniometric'><string name='filename' value='g.pfm'/><rgb "
      "name='intensity' value='3'/>";
  const auto scene = built(light + "</emitter>" + kSpeck, {{"g.pfm", pfm(kSide, kSide, gray)}});
  ASSERT_NE(scene, nullptr);
  rng::Stream stream(rng::key(13));
  for (int i = 0; i < 500; ++i) {
    const Vec3 d = normalize(test::uniform_direction(stream));
    const Vec2 uv =
        equal_area_square({static_cast<double>(d.x), static_cast<double>(d.z), static_cast<double>(d.y)});
    const float x = uv.x * kSide, y = uv.y * kSide;
    if (std::abs(x - std::round(x)) < 1e-3f || std::abs(y - std::round(y)) < 1e-3f) continue;
    const auto texel = static_cast<std::size_t>(static_cast<int>(y) * kSide + static_cast<int>(x));
    EXPECT_NEAR(intensity(*scene, d), 3 * static_cast<double>(gray[texel]), 1e-4);
  }
  double mean = 0;
  for (const float v : gray) mean += 3 * static_cast<double>(v) / (kSide * kSide);
  double total = 0;
  constexpr int kDraws = 20000;
  int found = 0;
  std::vector<double> observed(gray.size()), expected(gray.size());
  test::Draws draws(13, 1);
  for (int i = 0; i < kDraws; ++i) {
    EmissionSample out;
    if (!test::draw_emission(*scene, draws, out)) continue;
    ++found;
    const Vec3d d(out.ray.direction);
    const Vec2 uv = equal_area_square({d.x, d.z, d.y});
    const auto cell = [](float v) { return std::min(static_cast<int>(v * kSide), kSide - 1); };
    ++observed[static_cast<std::size_t>(cell(uv.y) * kSide + cell(uv.x))];
    total += static_cast<double>(out.weight.g);
    // The density is that of the intensity: the weight is the power, whatever the direction.
    EXPECT_NEAR(static_cast<double>(out.weight.g) / (4 * kPi * mean), 1, 1e-4);
  }
  EXPECT_GT(found, kDraws - 10);
  for (std::size_t i = 0; i < gray.size(); ++i)
    expected[i] = found * 3 * static_cast<double>(gray[i]) / (mean * kSide * kSide);
  EXPECT_GT(test::chi_squared_p(observed, expected), 1e-6);
  EXPECT_NEAR(total / kDraws / (4 * kPi * mean), 1, 1e-3);
  // A quarter turn about x takes +y to +z.
  const auto turned =
      built(light + "<transform name='to_world'><rotate x='1' angle='90'/></transform></emitter>" + kSpeck,
            {{"g.pfm", pfm(kSide, kSide, gray)}});
  ASSERT_NE(turned, nullptr);
  EXPECT_NEAR(intensity(*turned, normalize(Vec3{0.1f, -0.2f, 0.9f})),
              intensity(*scene, normalize(Vec3{0.1f, 0.9f, 0.2f})), 1e-5);
  const auto power = built(light + "<float name='power' value='7'/></emitter>" + kSpeck,
                           {{"g.pfm", pfm(kSide, kSide, gray)}});
  ASSERT_NE(power, nullptr);
  const Vec3 d = normalize(Vec3{0.3f, 0.5f, 0.2f});
  EXPECT_NEAR(intensity(*power, d) / intensity(*scene, d), 7 / (4 * kPi * mean), 1e-4);

  const auto refused = [&](int width, int height, const std::string& more) {
    const auto bad = test::build_scene(
        light + more + "</emitter>" + kSpeck,
        {{"g.pfm", pfm(width, height, std::vector<float>(static_cast<std::size_t>(width * height)))}});
    return bad.ok() ? std::string("ok") : bad.error().to_string();
  };
  EXPECT_NE(refused(4, 2, "").find("square"), std::string::npos) << refused(4, 2, "");
  EXPECT_EQ(refused(4, 4, ""), "ok");  // black: there is no light
  EXPECT_NE(refused(4, 4, "<float name='power' value='7'/>").find("black light"), std::string::npos);
}

// Claim: a projection light has its picture's intensity, right towards -x of the projector, whatever the
// angle; scaled to a power, light that leaves has that mean.
TEST(ProjectionLights, HaveTheIntensityOfTheirPicture) {
  const std::map<std::string, std::string> files = {{"p.pfm", pfm(2, 1, {1, 3})}};
  const std::string head =
      "<emitter type='projector'><string name='quantity' value='intensity'/><string "
      "name='fov_axis' value='smaller'/><float name='fov' value='60'/><texture "
      "name='irradiance' type='bitmap'><string name='filename' value='p.pfm'/><string "
      "name='filter_type' value='nearest'/></texture>";
  const auto scene = built(head + "<float name='scale' value='2'/></emitter>" + kSpeck, files);
  ASSERT_NE(scene, nullptr);
  for (const float y : {0.0f, 0.3f, -0.5f})
    for (const float x : {0.1f, 0.8f, 1.1f}) {
      EXPECT_NEAR(intensity(*scene, normalize(Vec3{x, y, 1})), 2, 1e-5);
      EXPECT_NEAR(intensity(*scene, normalize(Vec3{-x, y, 1})), 6, 1e-5);
    }
  EXPECT_EQ(intensity(*scene, normalize(Vec3{0.1f, 0.6f, 1})), 0);
  const auto power = built(head + "<float name='power' value='5'/></emitter>" + kSpeck, files);
  ASSERT_NE(power, nullptr);
  test::Draws draws(14, 1);
  test::Mean weight;
  constexpr int kDraws = 100000;
  for (int i = 0; i < kDraws; ++i) {
    EmissionSample out;
    weight.add(test::draw_emission(*power, draws, out) ? static_cast<double>(out.weight.g) : 0.0);
  }
  EXPECT_NEAR(weight.mean(), 5, 0.1);  // 9 standard errors
}

// Claim: the luminance that leaves an area light is its power, of any shape, constant or textured.
TEST(AreaLightPower, ScalesTheRadiance) {
  const auto total = [](const std::string& shape, const std::string& radiance) {
    const auto scene = built("<shape type='" + shape + "'><emitter type='area'>" + radiance +
                             "<float name='power' value='6'/></emitter></shape>");
    if (scene == nullptr) return 0.0;
    test::Draws draws(15, 1);
    test::Mean weight;
    constexpr int kDraws = 20000;
    for (int i = 0; i < kDraws; ++i) {
      EmissionSample out;
      const bool found = test::draw_emission(*scene, draws, out);
      weight.add(found ? static_cast<double>(luminance(out.weight)) : 0.0);
    }
    return weight.mean();
  };
  const std::string color = "<rgb name='radiance' value='1, 2, 0.5'/>";
  const std::string checker =
      "<texture name='radiance' type='checkerboard'><rgb name='color0' value='0.2'/><rgb "
      "name='color1' value='1'/></texture>";
  for (const char* shape : {"sphere", "rectangle", "cube", "disk"}) {
    EXPECT_NEAR(total(shape, color), 6, 1e-3) << shape;
    EXPECT_NEAR(total(shape, checker), 6, 0.2) << shape;  // 7 standard errors
  }
  const auto black = test::build_scene(
      "<shape type='sphere'><emitter type='area'><rgb name='radiance' value='0'/><float name='power' "
      "value='6'/></emitter></shape>");
  ASSERT_FALSE(black.ok());
  EXPECT_NE(black.error().to_string().find("black light cannot be scaled"), std::string::npos);
}

// Claim: a sky of a given illuminance lights a plane that faces its +z with it.
TEST(SkyIlluminance, LightsAPlaneThatFacesUp) {
  constexpr int kSide = 32;
  std::vector<float> gray(kSide * kSide);
  for (int i = 0; i < kSide * kSide; ++i)
    gray[static_cast<std::size_t>(i)] = 0.5f + static_cast<float>(i % 7);
  const std::string head = "<emitter type='envmap'><string name='filename' value='s.pfm'/>";
  const auto scene = built(head +
                               "<string name='mapping' value='equalarea'/><float name='illuminance' "
                               "value='9'/></emitter>" +
                               kSpeck,
                           {{"s.pfm", pfm(kSide, kSide, gray)}});
  ASSERT_NE(scene, nullptr);
  // By a grid of directions, uniform in z^2: the cosine is their density.
  double sum = 0;
  constexpr int kSteps = 200;
  for (int i = 0; i < kSteps; ++i)
    for (int j = 0; j < kSteps; ++j) {
      const double z = std::sqrt((i + 0.5) / kSteps), phi = 2 * kPi * (j + 0.5) / kSteps,
                   s = std::sqrt(1 - z * z);
      sum += static_cast<double>(
          luminance(scene->environment(Vec3(Vec3d{s * std::cos(phi), s * std::sin(phi), z}))));
    }
  EXPECT_NEAR(sum * kPi / (kSteps * kSteps), 9, 0.09);
  const auto flat = test::build_scene(head + "<float name='illuminance' value='9'/></emitter>" + kSpeck,
                                      {{"s.pfm", pfm(kSide, kSide, gray)}});
  ASSERT_FALSE(flat.ok());
  EXPECT_NE(flat.error().to_string().find("equalarea"), std::string::npos);
}

}  // namespace
}  // namespace candela::scene
