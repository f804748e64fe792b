// The path tracer against answers known in closed form. Each block test alarms falsely with probability at
// most 1e-4 (Bonferroni over all blocks and channels), so the whole file with at most about 1e-3.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/proofs/proofs.h"
#include "tests/statistical/harness.h"

namespace candela::statistical {
namespace {

// Films decide these tests: proofs.h.
const proofs::FilmsDecide kFilms({"Analytic"});

constexpr double kAlpha = 1e-4;

void expect_agreement(const std::vector<std::vector<float>>& batches, const std::vector<float>& expected,
                      std::uint32_t width, std::uint32_t height, double max_relative_error = 0.02) {
  const BlockTestResult result =
      block_test(batches, expected, {}, width, height, {8, max_relative_error, 0, {}});
  EXPECT_GT(result.tested, 0U);
  EXPECT_LE(result.skipped * 10, result.tested) << "too noisy to say anything";
  EXPECT_GT(result.adjusted_p, kAlpha) << result.worst;
  EXPECT_LT(result.median_relative_standard_error, max_relative_error);
}

std::vector<float> uniform_image(std::uint32_t width, std::uint32_t height, float value) {
  return std::vector<float>(std::size_t{width} * height * 3, value);
}

// Claim: in a closed sphere that emits Le and reflects rho diffusely, radiance is Le / (1 - rho) everywhere,
// over all bounces.
TEST(Analytic, EnclosureConvergesToGeometricSeries) {
  const std::string xml = R"(<scene version="3.0.0">
    <integrator type="path"><integer name="max_depth" value="-1"/></integrator>
    <sensor type="perspective"><float name="fov" value="60"/></sensor>
    <shape type="sphere"><float name="radius" value="2"/><boolean name="flip_normals" value="true"/>
      <bsdf type="diffuse"><rgb name="reflectance" value="0.5, 0.25, 0.75"/></bsdf>
      <emitter type="area"><rgb name="radiance" value="1, 3, 0.5"/></emitter></shape></scene>)";
  const auto batches = render_batches(scene_from_xml(xml, 32, 24), 11, 16, 64);
  std::vector<float> expected;
  for (int i = 0; i < 32 * 24; ++i) expected.insert(expected.end(), {2.0f, 4.0f, 2.0f});
  expect_agreement(batches, expected, 32, 24);
}

// Claim: a depth limit cuts the series where Mitsuba says: max_depth d sums d terms.
TEST(Analytic, MaxDepthCutsTheSeries) {
  for (int depth : {0, 1, 2, 3, 7}) {
    const std::string xml = R"(<scene version="3.0.0">
    <integrator type="path"><integer name="max_depth" value=")" +
                            std::to_string(depth) + R"("/></integrator>
    <sensor type="perspective"><float name="fov" value="60"/></sensor>
    <shape type="sphere"><boolean name="flip_normals" value="true"/>
      <bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf>
      <emitter type="area"><rgb name="radiance" value="1"/></emitter></shape></scene>)";
    const auto batches = render_batches(scene_from_xml(xml, 16, 16), 100, 8, 64);
    const auto value = static_cast<float>(2 * (1 - std::pow(0.5, depth)));
    if (depth == 0) {
      for (const auto& batch : batches) EXPECT_EQ(batch, uniform_image(16, 16, 0.0f));
    } else {
      expect_agreement(batches, uniform_image(16, 16, value), 16, 16);
    }
  }
}

// Claim: white furnace. A convex object that absorbs nothing disappears in a constant environment.
TEST(Analytic, WhiteFurnace) {
  for (const char* bsdf :
       {R"(<bsdf type="diffuse"><rgb name="reflectance" value="1"/></bsdf>)", R"(<bsdf type="dielectric"/>)",
        R"(<bsdf type="conductor"><string name="material" value="none"/></bsdf>)"}) {
    const std::string xml = R"(<scene version="3.0.0">
    <integrator type="path"><integer name="max_depth" value="-1"/></integrator>
    <sensor type="perspective"><float name="fov" value="50"/>
      <transform name="to_world"><lookat origin="0, 0, -4" target="0, 0, 0" up="0, 1, 0"/></transform></sensor>
    <emitter type="constant"><rgb name="radiance" value="1.5"/></emitter>
    <shape type="sphere">)" +
                            std::string(bsdf) + "</shape></scene>";
    const auto batches = render_batches(scene_from_xml(xml, 32, 32), 500, 12, 64);
    expect_agreement(batches, uniform_image(32, 32, 1.5f), 32, 32);
  }
}

// The plane y = 0 seen straight from above by a pinhole at height `eye`, looking down, up = +z: radiance of
// pixel (x, y) by averaging `radiance_at` over the pixel.
template <class RadianceAt>
std::vector<float> plane_from_above(std::uint32_t size, double fov_degrees, double eye,
                                    const RadianceAt& radiance_at) {
  std::vector<float> image;
  const double half = eye * std::tan(fov_degrees * std::numbers::pi / 360);
  constexpr int kSub = 16;
  for (std::uint32_t y = 0; y < size; ++y) {
    for (std::uint32_t x = 0; x < size; ++x) {
      double sum = 0;
      for (int sy = 0; sy < kSub; ++sy)
        for (int sx = 0; sx < kSub; ++sx) {
          const double fx = (x + (sx + 0.5) / kSub) / size * 2 - 1,
                       fy = (y + (sy + 0.5) / kSub) / size * 2 - 1;
          sum += radiance_at(half * fx,
                             half * fy);  // both scenes are symmetric: the orientation does not matter
        }
      const auto value = static_cast<float>(sum / (kSub * kSub));
      image.insert(image.end(), {value, value, value});
    }
  }
  return image;
}

constexpr const char* kPlaneFromAbove = R"(
    <sensor type="perspective"><float name="fov" value="40"/>
      <transform name="to_world"><lookat origin="0, 10, 0" target="0, 0, 0" up="0, 0, 1"/></transform></sensor>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="50"/></transform>
      <bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="0.6"/></bsdf></bsdf></shape>)";

// Claim: a point light of intensity I lights a diffuse plane with rho / pi * I cos / r^2.
TEST(Analytic, PointLightFalloff) {
  const std::string xml =
      R"(<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="2"/></integrator>)" +
      std::string(kPlaneFromAbove) + R"(
    <emitter type="point"><point name="position" x="0" y="2" z="0"/><rgb name="intensity" value="7"/></emitter></scene>)";
  const auto batches = render_batches(scene_from_xml(xml, 48, 48), 7, 8, 64);
  const auto expected = plane_from_above(48, 40, 10, [](double x, double z) {
    const double squared = x * x + z * z + 4;
    return 0.6 / std::numbers::pi * 7 * 2 / (squared * std::sqrt(squared));
  });
  expect_agreement(batches, expected, 48, 48);
}

// Claim: a sphere light of radiance L and radius R wholly above the plane gives irradiance pi L (R/d)^2 cos,
// d to its centre: with next event estimation alone, with bsdf sampling alone (the balance of both is what is
// rendered), and whatever the size of the light.
TEST(Analytic, SphereLightOverPlane) {
  for (double radius : {0.02, 0.5, 1.4}) {
    const std::string xml =
        R"(<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="2"/>
        <boolean name="hide_emitters" value="true"/></integrator>
    <sensor type="perspective"><float name="fov" value="12"/>
      <transform name="to_world"><lookat origin="30, 10, 0" target="0, 0, 0" up="0, 1, 0"/></transform></sensor>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="80"/></transform>
      <bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="0.6"/></bsdf></bsdf></shape>
    <shape type="sphere"><float name="radius" value=")" +
        std::to_string(radius) +
        R"("/><point name="center" x="0" y="8" z="0"/>
      <bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>
      <emitter type="area"><rgb name="radiance" value=")" +
        std::to_string(1 / (radius * radius)) + R"("/></emitter></shape></scene>)";
    // The camera looks down past the light: every pixel sees the plane.
    const auto batches = render_batches(scene_from_xml(xml, 32, 32), 7, 12, 64);
    // Camera geometry in double: forward, right, up of the lookat.
    const std::array<double, 3> eye = {30, 10, 0};
    const double norm = std::sqrt(1000.0);
    const std::array<double, 3> forward = {-30 / norm, -10 / norm, 0};
    const std::array<double, 3> up = {-10 / norm, 30 / norm, 0};
    const double half = std::tan(6 * std::numbers::pi / 180);
    std::vector<float> expected;
    constexpr int kSub = 8;
    for (int y = 0; y < 32; ++y)
      for (int x = 0; x < 32; ++x) {
        double sum = 0;
        for (int s = 0; s < kSub * kSub; ++s) {
          const double fx = ((x + (s % kSub + 0.5) / kSub) / 32 * 2 - 1) * half;
          const double fy = (1 - (y + (s / kSub + 0.5) / kSub) / 32 * 2) * half;
          // Sideways is +-z: the scene is symmetric in z.
          const std::array<double, 3> d = {forward[0] + fy * up[0], forward[1] + fy * up[1], fx};
          const double t = -eye[1] / d[1];
          const double px = eye[0] + t * d[0], pz = t * d[2];
          const double squared = px * px + 64 + pz * pz;
          sum += 0.6 / std::numbers::pi * std::numbers::pi / squared * 8 / std::sqrt(squared);
        }
        const auto value = static_cast<float>(sum / (kSub * kSub));
        expected.insert(expected.end(), {value, value, value});
      }
    expect_agreement(batches, expected, 32, 32);
  }
}

// Claim: the expectation is the same with all skips of the plan disabled, with either heuristic and either
// sampler, and without low-discrepancy points. Compared with each other on a scene that has no closed form.
TEST(Analytic, PlanHeuristicAndSamplerDoNotChangeTheMean) {
  const std::string xml =
      R"(<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="6"/></integrator>)" +
      std::string(kPlaneFromAbove) + R"(
    <shape type="sphere"><point name="center" x="1" y="1" z="0.5"/><bsdf type="dielectric"/></shape>
    <shape type="sphere"><point name="center" x="-1.5" y="1" z="0"/><bsdf type="roughconductor"><float name="alpha" value="0.3"/></bsdf></shape>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/><translate y="5"/></transform>
      <emitter type="area"><rgb name="radiance" value="9"/></emitter></shape>
    <emitter type="constant"><rgb name="radiance" value="0.3"/></emitter></scene>)";
  const auto render_with = [&](const char* key, const char* value, const char* sampler, std::uint64_t seed) {
    TestScene scene = scene_from_xml(xml, 32, 32);
    if (key != nullptr) scene.settings.integrator_settings[key] = value;
    scene.settings.sampler = sampler;
    return render_batches(scene, seed, 12, 96);
  };
  const auto base = render_with(nullptr, nullptr, "sobol", 1000);
  std::vector<float> mean(base[0].size()), deviation(base[0].size());
  for (std::size_t i = 0; i < mean.size(); ++i) {
    double sum = 0, squares = 0;
    for (const auto& batch : base) sum += static_cast<double>(batch[i]) / 12;
    for (const auto& batch : base) squares += std::pow(static_cast<double>(batch[i]) - sum, 2);
    mean[i] = static_cast<float>(sum);
    deviation[i] = static_cast<float>(std::sqrt(squares / 11 / 12));
  }
  const auto check = [&](const std::vector<std::vector<float>>& other, const char* what) {
    const BlockTestResult result = block_test(other, mean, deviation, 32, 32, {16, 0.1, 0, {}});
    EXPECT_GE(result.tested, 10U) << what;
    EXPECT_GT(result.adjusted_p, kAlpha) << what << ": " << result.worst;
  };
  check(render_with("plan", "full", "sobol", 2000), "plan=full");
  check(render_with("heuristic", "balance", "sobol", 3000), "heuristic=balance");
  check(render_with(nullptr, nullptr, "independent", 4000), "sampler=independent");
  check(render_with("rr_depth", "1", "sobol", 5000), "rr_depth=1");
}

// Claim: the block test sees a bias. An answer 1 % off in one block is refused (the test of the test).
TEST(Analytic, TheBlockTestCanFail) {
  const std::string xml = R"(<scene version="3.0.0">
    <integrator type="path"><integer name="max_depth" value="-1"/></integrator>
    <sensor type="perspective"><float name="fov" value="60"/></sensor>
    <shape type="sphere"><boolean name="flip_normals" value="true"/>
      <bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf>
      <emitter type="area"><rgb name="radiance" value="1"/></emitter></shape></scene>)";
  const auto batches = render_batches(scene_from_xml(xml, 32, 32), 1, 16, 256);
  std::vector<float> expected = uniform_image(32, 32, 2.0f);
  for (std::uint32_t y = 8; y < 16; ++y)
    for (std::uint32_t x = 8; x < 16; ++x) expected[(y * 32 + x) * 3 + 1] *= 1.01f;
  const BlockTestResult result = block_test(batches, expected, {}, 32, 32, {8, 0.02, 0, {}});
  EXPECT_LT(result.adjusted_p, kAlpha);
}

}  // namespace
}  // namespace candela::statistical
