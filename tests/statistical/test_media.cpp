// Light through media and through surfaces it passes straight, against closed forms, quadrature and itself.
// Each block test alarms falsely with probability at most 1e-5 (Bonferroni over all blocks and channels);
// there are fewer than 60 of them, and fewer than 60 tests at 5 standard errors: the whole file alarms
// falsely with probability below 7e-4.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <numbers>

#include "tests/proofs/proofs.h"
#include "tests/statistical/harness.h"
#include "tests/statistical/moments.h"
#include "tests/unit/volume_file.h"
#include "worker/estimators/path_dispatch.h"

namespace candela::statistical {
namespace {

// Films decide these tests: proofs.h.
const proofs::FilmsDecide kFilms({"Media"});

constexpr double kAlpha = 1e-5;

void expect_agreement(const std::vector<std::vector<float>>& batches, const std::vector<float>& expected,
                      std::uint32_t size, const std::string& what, double max_relative_error = 0.02) {
  const BlockTestResult result =
      block_test(batches, expected, {}, size, size, {8, max_relative_error, 0, {}});
  EXPECT_GT(result.tested, 0U) << what;
  EXPECT_LE(result.skipped * 10, result.tested) << what << ": too noisy to say anything";
  EXPECT_GT(result.adjusted_p, kAlpha) << what << ": " << result.worst;
}

std::vector<float> uniform_image(std::uint32_t size, std::array<double, 3> value) {
  std::vector<float> image;
  for (std::uint32_t i = 0; i < size * size; ++i)
    for (const double v : value) image.push_back(static_cast<float>(v));
  return image;
}

TestScene scene_with(const std::string& body, std::uint32_t size,
                     std::map<std::string, std::string> files = {}, int max_depth = -1) {
  TestScene scene =
      scene_from_xml("<scene version=\"3.0.0\"><integrator type=\"volpath\"/></scene>", size, size);
  files["scene.xml"] = "<scene version=\"3.0.0\"><integrator type=\"volpath\"/>" + body + "</scene>";
  scene.files = std::make_shared<MemorySource>(std::move(files));
  scene.settings.integrator_settings["max_depth"] = std::to_string(max_depth);
  return scene;
}

// Parallel rays along +z from z = -5, over [-0.5, 0.5]^2.
const std::string kParallel =
    R"(<sensor type="orthographic"><transform name="to_world"><scale x="0.5" y="0.5"/><translate z="-5"/></transform></sensor>)";
const std::string kPerspective =
    R"(<sensor type="perspective"><float name="fov" value="40"/><transform name="to_world"><translate z="-5"/></transform></sensor>)";

std::string environment(double radiance) {
  return "<emitter type=\"constant\"><rgb name=\"radiance\" value=\"" + std::to_string(radiance) +
         "\"/></emitter>";
}

std::string medium(const std::string& sigma_t, const std::string& albedo, const std::string& phase = "") {
  return R"(<medium name="interior" type="homogeneous"><rgb name="sigma_t" value=")" + sigma_t +
         R"("/><rgb name="albedo" value=")" + albedo + "\"/>" + phase + "</medium>";
}

// [-1, 1]^3 filled by the grid "v.vol".
std::string grid_medium(double scale, const std::string& albedo, const std::string& phase = "") {
  return R"(<medium name="interior" type="heterogeneous"><float name="scale" value=")" +
         std::to_string(scale) +
         R"("/><volume name="sigma_t" type="gridvolume"><string name="filename" value="v.vol"/>
         <transform name="to_world"><translate x="-0.5" y="-0.5" z="-0.5"/><scale value="2"/></transform></volume>
         <rgb name="albedo" value=")" +
         albedo + "\"/>" + phase + "</medium>";
}

std::string noise_file(int channels) {
  rng::Stream stream(9);
  std::vector<float> values;
  for (int i = 0; i < 12 * 12 * 12 * channels; ++i) {
    const float u = stream.next_float();
    values.push_back(u < 0.5f ? 0.0f : 2 * u);
  }
  return test::volume_file({12, 12, 12}, channels, values);
}

const char* const kForward = R"(<phase type="hg"><float name="g" value="0.7"/></phase>)";

// Claim: a medium that only absorbs darkens what is behind it by exp(-sigma_t d) in each channel, whether the
// path may scatter or not, and twice where two lie one behind the other.
TEST(Media, AbsorbingSlab) {
  const std::array<double, 3> sigma = {0.2, 0.7, 1.5};
  const std::string slab = medium("0.2, 0.7, 1.5", "0");
  for (const int max_depth : {1, -1})
    for (const int slabs : {1, 2}) {
      std::string body = kParallel + environment(3) + "<shape type=\"cube\">" + slab + "</shape>";
      if (slabs == 2)
        body += "<shape type=\"cube\"><transform name=\"to_world\"><translate z=\"4\"/></transform>" + slab +
                "</shape>";
      std::array<double, 3> expected{};
      for (std::size_t c = 0; c < 3; ++c) expected[c] = 3 * std::exp(-sigma[c] * 2 * slabs);
      const auto batches = render_batches(scene_with(body, 16, {}, max_depth), 31, 10, 64);
      if (max_depth == 1) {
        for (std::size_t i = 0; i < batches[0].size(); ++i)
          ASSERT_NEAR(static_cast<double>(batches[0][i]) / expected[i % 3], 1, 1e-4);
      } else {
        expect_agreement(batches, uniform_image(16, expected), 16, "slab");
      }
    }
}

// Claim: white furnace. Whatever scatters without absorbing disappears in a constant environment: homogeneous
// media, gray and coloured, thin and thick, grids, inside glass, around the camera.
TEST(Media, ConservativeMediaVanish) {
  const std::string ball = R"(<shape type="sphere"><bsdf type="dielectric"/>)";
  const std::string box = "<shape type=\"cube\">";
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"thin", box + medium("0.5", "1") + "</shape>"},
      {"forward", box + medium("3", "1", kForward) + "</shape>"},
      {"coloured", box + medium("0.3, 1, 4", "1") + "</shape>"},
      {"thick", box + medium("8", "1") + "</shape>"},
      {"very thick", box + medium("60", "1") + "</shape>"},
      {"grid", box + grid_medium(2, "1", kForward) + "</shape>"},
      {"coloured grid", box + grid_medium(2, "1") + "</shape>"},
      {"glass", ball + medium("2", "1") + "</shape>"},
      {"around the camera", ""}};
  for (const auto& [name, shape] : cases) {
    std::map<std::string, std::string> files = {{"v.vol", noise_file(name == "coloured grid" ? 3 : 1)}};
    std::string sensor = kPerspective;
    std::string body = shape;
    if (name == "around the camera") {
      body =
          R"(<medium id="fog" type="homogeneous"><float name="sigma_t" value="0.3"/><float name="albedo" value="1"/></medium>
        <shape type="sphere"><float name="radius" value="6"/><ref name="interior" id="fog"/></shape>)";
      sensor = R"(<sensor type="perspective"><float name="fov" value="40"/><ref id="fog"/>
        <transform name="to_world"><translate z="-5"/></transform></sensor>)";
    }
    const int iterations = name == "thick" || name.starts_with("coloured") ? 48 : 24;
    const auto batches =
        render_batches(scene_with(sensor + environment(1.5) + body, 16, files), 77, 10, iterations);
    expect_agreement(batches, uniform_image(16, {1.5, 1.5, 1.5}), 16, name);
  }
}

// Chandrasekhar's H function of isotropic scattering with albedo w, by iteration.
double chandrasekhar_h(double mu, double w) {
  constexpr int kNodes = 400;
  std::vector<double> h(kNodes, 1.0);
  const auto next = [&](double m) {
    double integral = 0;
    for (int i = 0; i < kNodes; ++i) {
      const double x = (i + 0.5) / kNodes;
      integral += x * h[static_cast<std::size_t>(i)] / (m + x) / kNodes;
    }
    return 1 / (std::sqrt(1 - w) + w / 2 * integral);
  };
  for (int round = 0; round < 60; ++round) {
    std::vector<double> better;
    for (int i = 0; i < kNodes; ++i) better.push_back(next((i + 0.5) / kNodes));
    h = better;
  }
  return next(mu);
}

// Claim: a medium too thick to see through, up to 1e5 mean free paths, reflects even light as Chandrasekhar
// found: 1 - sqrt(1 - w) H(1) seen from straight above. What leaks where rounding puts a vertex outside would
// make it brighter or darker.
TEST(Media, ThickMediumReflectsByTheHFunction) {
  constexpr double kAlbedo = 0.8;
  const double expected = 1 - std::sqrt(1 - kAlbedo) * chandrasekhar_h(1, kAlbedo);
  for (const double sigma_t : {30.0, 1e3, 5e4})
    for (const bool grid : {false, true}) {
      const std::string inside = grid ? grid_medium(sigma_t, "0.8") : medium(std::to_string(sigma_t), "0.8");
      const std::string body = kParallel + environment(1) +
                               "<shape type=\"cube\"><transform name=\"to_world\">" +
                               (grid ? "<scale value=\"1\"/>" : "<scale x=\"50\" y=\"50\" z=\"1\"/>") +
                               "</transform>" + inside + "</shape>";
      // The grid ends at the cube's sides, which 30 mean free paths are not far enough from.
      if (grid && sigma_t < 100) continue;
      const auto batches =
          render_batches(scene_with(body, 16, {{"v.vol", test::volume_file({1, 1, 1}, 1, {1})}}), 41, 10, 48);
      expect_agreement(batches, uniform_image(16, {expected, expected, expected}), 16,
                       "sigma_t = " + std::to_string(sigma_t) + (grid ? ", grid" : ""));
    }
}

// Claim: a sheet that lets a fraction pass dims by that fraction, seen directly, by next event estimation and
// by scattered rays alike; null surfaces do nothing; none of them counts as a bounce.
TEST(Media, StraightSurfaces) {
  const std::string black = R"(<bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>)";
  // All within a sphere that a third of the light passes, and two that nothing stops.
  const std::string around =
      R"(<shape type="sphere"><float name="radius" value="20"/><bsdf type="mask"><float name="opacity" value="0.6666667"/>)" +
      black +
      R"(</bsdf></shape><shape type="sphere"><float name="radius" value="19"/><bsdf type="null"/></shape>
      <shape type="sphere"><float name="radius" value="21"/><bsdf type="null"/></shape>)";
  const auto seen = render_batches(scene_with(kPerspective + environment(3) + around, 16, {}, 1), 3, 10, 64);
  expect_agreement(seen, uniform_image(16, {1, 1, 1}), 16, "seen directly");
  const std::string plane =
      R"(<shape type="rectangle"><transform name="to_world"><scale value="30"/><rotate x="1" angle="180"/><translate z="1"/></transform>
      <bsdf type="diffuse"><rgb name="reflectance" value="0.8"/></bsdf></shape>)";
  const auto lit =
      render_batches(scene_with(kPerspective + environment(3) + around + plane, 16, {}, 2), 4, 10, 64);
  expect_agreement(lit, uniform_image(16, {0.8, 0.8, 0.8}), 16, "lit");
}

// Claim: a lamp behind a box of absorbing medium, bounded by nothing that is seen, and behind a mask, lights
// a plane by what the closed form says: small enough that the way through the box hardly varies.
TEST(Media, LampThroughABox) {
  for (const bool point : {true, false}) {
    // Light at height 10 over the camera's point; the box between is 2 thick along the way.
    const std::string lamp =
        point
            ? R"(<emitter type="point"><point name="position" x="0" y="10" z="0"/><rgb name="intensity" value="100"/></emitter>)"
            : R"(<shape type="sphere"><float name="radius" value="0.1"/><point name="center" x="0" y="10" z="0"/>
                 <emitter type="area"><rgb name="radiance" value="3183.0989"/></emitter></shape>)";
    const std::string body =
        R"(<sensor type="perspective"><float name="fov" value="0.5"/><transform name="to_world">
        <lookat origin="3, 3, 0" target="0, 0, 0" up="0, 1, 0"/></transform></sensor>
        <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="2"/></transform>
          <bsdf type="diffuse"><rgb name="reflectance" value="0.6"/></bsdf></shape>
        <shape type="cube"><transform name="to_world"><translate y="5"/></transform>)" +
        medium("0.1, 0.5, 1", "0") + R"(</shape>
        <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="2"/><translate y="8"/></transform>
          <bsdf type="mask"><float name="opacity" value="0.25"/><bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf></bsdf></shape>)" +
        lamp;
    std::array<double, 3> expected{};
    for (std::size_t c = 0; c < 3; ++c)
      expected[c] =
          0.6 / std::numbers::pi * 1.0 * 0.75 * std::exp(-2 * std::array<double, 3>{0.1, 0.5, 1}[c]);
    const auto batches = render_batches(scene_with(body, 8, {}, 2), 19, 10, 256);
    for (std::size_t c = 0; c < 3; ++c) {
      double sum = 0;
      for (const auto& batch : batches)
        for (std::size_t i = c; i < batch.size(); i += 3) sum += static_cast<double>(batch[i]);
      // Within the pixel's view and the lamp's size the way through the box and the cosine vary by less.
      EXPECT_NEAR(sum / (10 * 64) / expected[c], 1, 2e-3) << point << " " << c;
    }
  }
}

// Claim: light of a point lamp scattered once is the integral of sigma_s f T T I / r^2 along the ray.
TEST(Media, SingleScatteringByQuadrature) {
  for (const double g : {0.0, 0.6}) {
    const std::string fog =
        R"(<medium id="fog" type="homogeneous"><rgb name="sigma_t" value="0.2, 0.4, 0.6"/><rgb name="albedo" value="0.8"/>
        <phase type="hg"><float name="g" value=")" +
        std::to_string(g) + R"("/></phase></medium>)";
    const std::string body =
        fog +
        R"(<sensor type="orthographic"><float name="near_clip" value="0.0001"/><ref id="fog"/><transform name="to_world"><scale x="0.5" y="0.5"/><translate z="-3"/></transform></sensor>
        <emitter type="point"><point name="position" x="0" y="1.5" z="0"/><rgb name="intensity" value="2"/></emitter>
        <shape type="rectangle"><transform name="to_world"><scale value="9"/><rotate x="1" angle="180"/><translate z="4"/></transform>
          <bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf></shape>)";
    constexpr std::uint32_t kSize = 16;
    std::vector<float> expected;
    for (std::uint32_t y = 0; y < kSize; ++y)
      for (std::uint32_t x = 0; x < kSize; ++x) {
        std::array<double, 3> sum{};
        constexpr int kSub = 3, kSteps = 1400;
        for (int s = 0; s < kSub * kSub; ++s) {
          const double px = (x + (s % kSub + 0.5) / kSub) / kSize - 0.5,
                       py = 0.5 - (y + (s / kSub + 0.5) / kSub) / kSize;
          for (int i = 0; i < kSteps; ++i) {
            const double t = 7.0 * (i + 0.5) / kSteps, z = t - 3;
            const double r2 = px * px + (py - 1.5) * (py - 1.5) + z * z, r = std::sqrt(r2);
            const double cosine = z / r;  // light travels from the lamp to here, then towards -z
            const double d = 1 + g * g + 2 * g * cosine;
            const double phase = (1 - g * g) / (4 * std::numbers::pi * d * std::sqrt(d));
            for (std::size_t c = 0; c < 3; ++c) {
              const double sigma = 0.2 * static_cast<double>(c + 1);
              sum[c] +=
                  0.8 * sigma * phase * std::exp(-sigma * (t + r)) * 2 / r2 * 7.0 / kSteps / (kSub * kSub);
            }
          }
        }
        for (const double v : sum) expected.push_back(static_cast<float>(v));
      }
    const auto batches = render_batches(scene_with(body, kSize, {}, 2), 23, 12, 128);
    expect_agreement(batches, expected, kSize, "g = " + std::to_string(g));
  }
}

// The mean of an image's batches with its standard errors, to stand as a reference.
void mean_of(const std::vector<std::vector<float>>& batches, std::vector<float>& mean,
             std::vector<float>& error) {
  mean.clear();
  error.clear();
  for (std::size_t i = 0; i < batches[0].size(); ++i) {
    Moments value;
    for (const auto& batch : batches) value.add(static_cast<double>(batch[i]));
    mean.push_back(static_cast<float>(value.mean()));
    error.push_back(static_cast<float>(value.error()));
  }
}

// Claim: a grid of one value everywhere is a homogeneous medium.
TEST(Media, UniformGridIsHomogeneous) {
  const std::string light =
      environment(0.5) +
      R"(<emitter type="point"><point name="position" x="0" y="2" z="-2"/><rgb name="intensity" value="9"/></emitter>)";
  const std::string file = test::volume_file({5, 5, 5}, 1, std::vector<float>(125, 1.5f));
  const auto homogeneous =
      render_batches(scene_with(kParallel + light + "<shape type=\"cube\">" +
                                    medium("1.5", "0.9, 0.7, 0.5", kForward) + "</shape>",
                                16),
                     51, 12, 96);
  const auto grid = render_batches(scene_with(kParallel + light + "<shape type=\"cube\">" +
                                                  grid_medium(1, "0.9, 0.7, 0.5", kForward) + "</shape>",
                                              16, {{"v.vol", file}}),
                                   81, 12, 96);
  std::vector<float> mean, error;
  mean_of(homogeneous, mean, error);
  const BlockTestResult result = block_test(grid, mean, error, 16, 16, {8, 0.02, 0, {}});
  EXPECT_GT(result.tested, 0U);
  EXPECT_GT(result.adjusted_p, kAlpha) << result.worst;
}

// Claim: a lamp with a surface inside of a dense medium, and lamps outside, light it as they light a grid
// of the same medium, whose flights and shadow rays know nothing of clearances and of the roulette before
// rays.
TEST(Media, DenseMediaAreDenseGrids) {
  const std::string file = test::volume_file({1, 1, 1}, 1, {1});
  const auto ball = [](const std::string& z, const std::string& radius, const std::string& radiance) {
    return R"(<shape type="sphere"><point name="center" x="0.1" y="0" z=")" + z +
           R"("/><float name="radius" value=")" + radius +
           R"("/><emitter type="area"><rgb name="radiance" value=")" + radiance + R"("/></emitter></shape>)";
  };
  const auto point = [](const std::string& z, const std::string& intensity) {
    return R"(<emitter type="point"><point name="position" x="-0.1" y="0.1" z=")" + z +
           R"("/><rgb name="intensity" value=")" + intensity + R"("/></emitter>)";
  };
  const std::string albedo = "0.95, 0.9, 0.8";
  int number = 0;
  for (const std::string& lamp :
       {ball("-0.6", "0.2", "20"), ball("-3", "0.4", "30"), point("-2", "5") + environment(0.5)}) {
    const auto rendered = [&](const std::string& inside, std::uint64_t seed) {
      return render_batches(
          scene_with(kParallel + lamp + "<shape type=\"cube\">" + inside + "</shape>", 8, {{"v.vol", file}}),
          seed, 12, 256);
    };
    std::vector<float> mean, error;
    mean_of(rendered(medium("12, 12, 12", albedo, number % 2 == 0 ? "" : kForward), 61), mean, error);
    const BlockTestResult result =
        block_test(rendered(grid_medium(12, albedo, number % 2 == 0 ? "" : kForward), 91), mean, error, 8, 8,
                   {8, 0.02, 0, {}});
    EXPECT_GT(result.tested, 0U) << lamp;
    EXPECT_GT(result.adjusted_p, kAlpha) << lamp << " " << result.worst;
    ++number;
  }
}

void expect_techniques_agree(const std::string& body, const std::vector<Vec2>& places) {
  const TestScene test = scene_with(body, 8, {{"v.vol", noise_file(1)}});
  const auto description = description::parse_scene(*test.files, "scene.xml", {});
  ASSERT_TRUE(description.ok()) << description.error().to_string();
  scene::Scene::Options options;
  const auto built = scene::Scene::build(*description, *test.files, options);
  ASSERT_TRUE(built.ok()) << built.error().to_string();
  const scene::Scene& scene = **built;
  const estimators::PathOptions limits = {4, 100, 2, transport::MisHeuristic::power};
  const auto estimate = [&](const estimators::Techniques& techniques, float x, float y, std::uint64_t seed,
                            int count) {
    Moments value;
    samplers::Sampler sampler(samplers::SamplerKind::independent, seed);
    film::SampleCounts sample_counts;
    if (proofs::probing()) count /= 50;
    for (int i = 0; i < count; ++i) {
      sampler.start(0, static_cast<std::uint64_t>(i), 0, 0);
      float weight = 1;
      value.add(static_cast<double>(luminance(estimators::path_radiance<transport::EdgeContent::media>(
          scene, limits, techniques, scene.camera_ray(x, y, {0.5f, 0.5f}, weight), sampler, sample_counts))));
    }
    const double sums[] = {value.mean(), value.error()};
    proofs::fact(fmt::format("radiance {} at {} {} in {}", seed, x, y, body), sums);
    return value;
  };
  estimators::Techniques both, by_light, by_scattering;
  by_light.hit_light = false;
  by_scattering.next_event = false;
  for (const Vec2 place : places) {
    const Moments all = estimate(both, place.x, place.y, 1, 60000);
    // Light sampled alone has heavy tails: beside a lamp it rarely chooses the sky, which scattering finds.
    const Moments light = estimate(by_light, place.x, place.y, 2, 1000000);
    const Moments scattered = estimate(by_scattering, place.x, place.y, 3, 200000);
    const double m0 = all.mean(), m1 = light.mean(), m2 = scattered.mean();
    const double e0 = all.error(), e1 = light.error(), e2 = scattered.error();
    EXPECT_GT(m0, 0.01);
    EXPECT_LT(e2, 0.05 * m2);
    EXPECT_LE(std::abs(m1 - m0), 5 * std::hypot(e0, e1)) << m0 << " " << m1 << " at " << place.x;
    EXPECT_LE(std::abs(m2 - m0), 5 * std::hypot(e0, e2)) << m0 << " " << m2 << " at " << place.x;
  }
}

// Claim: next event estimation alone, scattered rays alone, and both weighted have the same mean, through
// media and masks, lit by a lamp and an environment.
TEST(Media, TechniquesAgree) {
  const std::string body =
      kPerspective + environment(0.4) +
      R"(<shape type="sphere"><float name="radius" value="0.6"/><point name="center" x="0" y="2.4" z="0"/>
        <emitter type="area"><rgb name="radiance" value="8, 6, 4"/></emitter></shape>
      <shape type="cube"><transform name="to_world"><scale value="1.2"/></transform>)" +
      grid_medium(1, "0.9, 0.8, 0.6", kForward) + R"(</shape>
      <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="2"/><translate y="1.5"/></transform>
        <bsdf type="mask"><float name="opacity" value="0.4"/><bsdf type="twosided"><bsdf type="diffuse"/></bsdf></bsdf></shape>
      <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="3"/><translate y="-1.5"/></transform>
        <bsdf type="twosided"><bsdf type="diffuse"/></bsdf></shape>)";
  expect_techniques_agree(body, {Vec2{0.5f, 0.5f}, Vec2{0.3f, 0.35f}, Vec2{0.62f, 0.8f}, Vec2{0.5f, 0.9f}});
}

// Claim: so they do through a rough boundary: light sampled from its surface crosses the medium behind it.
TEST(Media, TechniquesAgreeThroughRoughGlass) {
  const std::string body = kPerspective + environment(0.3) +
                           R"(<shape type="sphere"><bsdf type="roughdielectric">
        <float name="alpha" value="0.4"/><string name="int_ior" value="water"/></bsdf>)" +
                           medium("0.5, 1.5, 3", "0.5, 0.7, 0.9", kForward) + R"(</shape>
      <shape type="sphere"><float name="radius" value="0.4"/>
        <emitter type="area"><rgb name="radiance" value="8, 6, 4"/></emitter></shape>)";
  expect_techniques_agree(body, {{0.5f, 0.5f}, {0.4f, 0.45f}, {0.55f, 0.65f}});
}

// Claim: the plan's choice of a kernel changes no mean: plan=full runs the one with everything.
TEST(Media, PlanDoesNotChangeTheMean) {
  const std::string body =
      kPerspective + environment(1) +
      R"(<shape type="sphere"><bsdf type="mask"><float name="opacity" value="0.5"/><bsdf type="twosided"><bsdf type="diffuse"/></bsdf></bsdf></shape>)";
  TestScene scene = scene_with(body, 16);
  const auto base = render_batches(scene, 5, 10, 64);
  std::vector<float> mean, error;
  mean_of(base, mean, error);
  scene.settings.integrator_settings["plan"] = "full";
  const BlockTestResult result =
      block_test(render_batches(scene, 105, 10, 64), mean, error, 16, 16, {8, 0.02, 0, {}});
  EXPECT_GT(result.tested, 0U);
  EXPECT_GT(result.adjusted_p, kAlpha) << result.worst;
}

}  // namespace
}  // namespace candela::statistical
