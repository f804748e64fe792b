// Media at the ends of what floats hold: mean free paths of 1e-6 and of 1e9, and a million boundaries. All
// integrators with iterations, upbp with each technique and with long beams; a rejected sample (NaN,
// infinity) fails. Comparisons allow 5 standard errors and a bias that is named: below 6e-7 each by chance,
// fewer than 40.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstring>
#include <stdexcept>

#include "tests/proofs/proofs.h"
#include "tests/statistical/harness.h"

namespace candela::statistical {
namespace {

// Films decide these tests: proofs.h.
const proofs::FilmsDecide kFilms({"HostileMedia.MillionMeanFreePathsAUnit", "HostileMedia.AlmostNothing"});

constexpr std::uint32_t kSize = 8;
constexpr std::size_t kBatches = 8;

struct Method {
  const char* integrator;
  SettingsMap settings;
  bool whole;  // finds all light: agrees with path
};

std::vector<Method> methods() {
  std::vector<Method> all = {{"path", {}, true},  {"light", {}, true},   {"bdpt", {}, true},
                             {"vcm", {}, true},   {"ppm", {}, false},    {"bpm", {}, false},
                             {"fppm", {}, false}, {"vcmplus", {}, true}, {"optimis", {}, false}};
  for (const char* techniques : {"all", "pp3d", "pb2d", "bp2d", "bb1d"})
    all.push_back({"upbp", {{"techniques", techniques}}, std::string_view(techniques) == "all"});
  all.push_back({"upbp", {{"techniques", "all"}, {"query_beams", "long"}, {"photon_beams", "long"}}, true});
  return all;
}

struct Mean {
  double value, error;
};

// Of the images of batches.
Mean mean_over(const std::vector<std::vector<double>>& batches) {
  double sum = 0, squares = 0;
  for (const auto& batch : batches) {
    double mean = 0;
    for (const double v : batch) {
      EXPECT_TRUE(std::isfinite(v));
      mean += v / static_cast<double>(batch.size());
    }
    sum += mean;
    squares += mean * mean;
  }
  const auto n = static_cast<double>(batches.size());
  const double mean = sum / n;
  return {mean, std::sqrt(std::max(squares / n - mean * mean, 0.0) / (n - 1))};
}

Mean mean_of(const TestScene& scene, const Method& method, std::uint64_t iterations) {
  std::vector<std::vector<double>> batches;
  for (const auto& image :
       render_batches(with_integrator(scene, method.integrator, method.settings), 71, kBatches, iterations))
    batches.emplace_back(image.begin(), image.end());
  return mean_over(batches);
}

// The same of an integrator without epochs, with one renderer: for scenes that take long to build.
Mean mean_of_one_renderer(const TestScene& scene, const Method& method, std::uint64_t iterations) {
  const auto renderer = make_renderer(with_integrator(scene, method.integrator, method.settings));
  render::RunContext run;
  run.threads = 2;
  const auto pilot = renderer->pilot(run);
  if (!pilot.ok()) throw std::runtime_error(pilot.error().to_string());
  std::vector<std::vector<double>> batches;
  for (std::uint64_t batch = 0; batch < kBatches; ++batch) {
    auto output = renderer->make_output(pilot->state);
    const Unit unit{Unit::Kind::iterations, 0, batch * iterations, (batch + 1) * iterations};
    const auto done = renderer->run(unit, {}, output, run);
    if (!done.ok()) throw std::runtime_error(done.error().to_string());
    for (const std::uint64_t rejected : output.film->sample_counts().rejected) EXPECT_EQ(rejected, 0U);
    std::vector<double>& image = batches.emplace_back();
    for (std::size_t i = 0; i < output.film->layout().pixel_count() * 3; ++i)
      image.push_back(std::ldexp(static_cast<double>(output.film->sums()[i]), -output.film->scale_log2()) /
                      static_cast<double>(iterations));
  }
  return mean_over(batches);
}

void expect_agree(const Mean& a, const Mean& b, double bias, const std::string& what) {
  std::printf("%-14s %.5f +- %.5f for %.5f +- %.5f\n", what.c_str(), a.value, a.error, b.value, b.error);
  EXPECT_NEAR(a.value, b.value, 5 * std::hypot(a.error, b.error) + bias * b.value) << what;
}

std::string called(const Method& method) {
  const auto techniques = method.settings.find("techniques");
  if (techniques == method.settings.end()) return method.integrator;
  return "upbp " + techniques->second + (method.settings.contains("query_beams") ? ", long beams" : "");
}

// A camera that sees a floor through `body`, below a lamp.
std::string view_of(const std::string& body) {
  return R"(<scene version="3.0.0"><integrator type="volpath"/>
    <sensor type="perspective"><float name="fov" value="30"/><transform name="to_world">
      <lookat origin="0, -6, 0" target="0, 0, 0" up="0, 0, 1"/></transform></sensor>
    <shape type="rectangle"><transform name="to_world"><scale value="6"/><rotate x="1" angle="90"/><translate y="3"/></transform>
      <bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf></shape>
    <shape type="sphere"><point name="center" x="2" y="-4" z="3"/><float name="radius" value="0.7"/>
      <emitter type="area"><rgb name="radiance" value="20"/></emitter></shape>)" +
         body + "</scene>";
}

// A block of two units across in the middle of the view.
std::string block(const char* sigma_t, const char* albedo) {
  return fmt::format(
      R"(<shape type="cube"><bsdf type="null"/><medium name="interior" type="homogeneous">
         <rgb name="sigma_t" value="{}"/><rgb name="albedo" value="{}"/></medium></shape>)",
      sigma_t, albedo);
}

// Claim: a medium of sigma_t = 1e6 is a wall that every integrator can stand, and those that find all light
// agree on how bright it is (2 %: floats resolve places on its face to a tenth of a mean free path).
TEST(HostileMedia, MillionMeanFreePathsAUnit) {
  const TestScene scene = scene_from_xml(view_of(block("1e6", "0.8")), kSize, kSize);
  const Mean path = mean_of(scene, methods().front(), 64);
  for (const Method& method : methods()) {
    const Mean mean = mean_of(scene, method, 16);
    if (method.whole)
      expect_agree(mean, path, 0.02, called(method));
    else
      EXPECT_GE(mean.value, 0);
  }
}

// Claim: a medium of sigma_t = 1e-9 changes nothing to seven digits: images are those without it.
TEST(HostileMedia, AlmostNothing) {
  const TestScene scene = scene_from_xml(view_of(block("1e-9", "0.8")), kSize, kSize);
  const TestScene without = scene_from_xml(view_of(""), kSize, kSize);
  for (const Method& method : methods()) {
    const Mean mean = mean_of(scene, method, 16);
    if (std::string_view(method.integrator) == "upbp")
      expect_agree(mean, mean_of(without, {"vcm", {}, true}, 16), 0.01, called(method));
    else
      expect_agree(mean, mean_of(without, method, 16), 0.001, called(method));
  }
}

// A PLY of count^3 cubes of a thin medium in [-1, 1]^3, twelve triangles each.
std::string cubes(int count) {
  const auto put = [](std::string& bytes, auto value) {
    char raw[sizeof(value)];
    std::memcpy(raw, &value, sizeof(value));
    bytes.append(raw, sizeof(value));
  };
  constexpr int kFaces[12][3] = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                                 {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  std::string vertices, faces;
  const float step = 2.0f / static_cast<float>(count);
  int first = 0;
  for (int z = 0; z < count; ++z)
    for (int y = 0; y < count; ++y)
      for (int x = 0; x < count; ++x, first += 8) {
        for (int corner = 0; corner < 8; ++corner)
          for (const auto& [cell, bit] : {std::pair{x, 1}, {y, 2}, {z, 4}})
            put(vertices, -1 + step * (static_cast<float>(cell) + ((corner & bit) != 0 ? 0.9f : 0.1f)));
        for (const auto& face : kFaces) {
          put(faces, static_cast<unsigned char>(3));
          for (const int corner : face) put(faces, static_cast<std::int32_t>(first + corner));
        }
      }
  return fmt::format(
             "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float "
             "y\nproperty float z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
             first, first / 8 * 12) +
         vertices + faces;
}

TestScene grid_of_cubes(int count) {
  TestScene scene;
  scene.files = std::make_shared<MemorySource>(std::map<std::string, std::string>{
      {"scene.xml",
       view_of(
           R"(<shape type="ply"><string name="filename" value="cubes.ply"/><boolean name="face_normals" value="true"/>
         <bsdf type="null"/><medium name="interior" type="homogeneous"><rgb name="sigma_t" value="0.7"/>
         <rgb name="albedo" value="0.9"/></medium></shape>)")},
      {"cubes.ply", cubes(count)}});
  scene.main_key = "scene.xml";
  return read_scene(std::move(scene), kSize, kSize);
}

// Claim: a million boundaries that light passes straight, some ninety on a ray, neither stop a walk nor lose
// light: bidirectional techniques and those of media agree with path tracing.
TEST(HostileMedia, MillionBoundaries) {
  const TestScene scene = grid_of_cubes(44);
  const Mean path = mean_of_one_renderer(scene, methods().front(), 64);
  const Mean without = mean_of_one_renderer(scene_from_xml(view_of(""), kSize, kSize), methods().front(), 64);
  EXPECT_GT(path.value, without.value + 0.001) << "nobody sees the medium";
  for (const Method& method : {Method{"vcm", {}, true}, Method{"upbp", {{"techniques", "all"}}, true}})
    expect_agree(mean_of_one_renderer(scene, method, 8), path, 0.01, called(method));
}

}  // namespace
}  // namespace candela::statistical
