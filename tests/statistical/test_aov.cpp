// The albedo against a furnace. Light of radiance 1 from everywhere makes of a convex body without
// transmission, by paths of two edges, exactly its albedo; where it is not, the light itself. So the image
// minus what the body does not cover is the albedo's AOV, which another estimator finds from other random
// numbers. A mask shows its backdrop by its transparency.
//
// False-alarm rate: each value is compared at 5 standard errors of 24 independent batches (t: 5e-5) over at
// most 24 values: below 1.2e-3, with fixed seeds, so that it passes always or never.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "tests/statistical/harness.h"
#include "tests/statistical/moments.h"

namespace candela::statistical {
namespace {

constexpr std::uint32_t kFurnaceSide = 16;
constexpr std::uint64_t kBatches = 24, kBatchIterations = 16;

// Means over the image of a channel of the film and of each AOV, batch by batch.
struct BatchesOfImage {
  std::vector<std::vector<double>> film, albedo, coverage;  // [channel][batch]
};

BatchesOfImage render_batches(const std::string& body) {
  TestScene scene = scene_from_xml(
      "<scene version='3.0.0'><integrator type='path'><integer name='max_depth' value='2'/></integrator>"
      "<sensor type='perspective'><float name='fov' value='40'/><transform name='to_world'><lookat "
      "origin='0,0,4' target='0,0,0' up='0,1,0'/></transform></sensor><emitter type='constant'/>" +
          body + "</scene>",
      kFurnaceSide, kFurnaceSide);
  scene.settings.aovs = "albedo,coverage";
  const auto renderer = make_renderer(scene);
  BatchesOfImage result;
  result.film.resize(3);
  result.albedo.resize(3);
  result.coverage.resize(1);
  NamedState state;
  state.film_scale_log2 = 30;
  for (std::uint64_t batch = 0; batch < kBatches; ++batch) {
    auto output = renderer->make_output(state);
    const std::uint64_t begin = batch * kBatchIterations;
    const auto done =
        renderer->run({Unit::Kind::iterations, 0, begin, begin + kBatchIterations}, {}, output, {1});
    if (!done.ok()) throw std::runtime_error(done.error().to_string());
    const auto mean = [](const std::int64_t* sums, std::uint32_t channels, std::uint32_t c, int scale) {
      double sum = 0;
      for (std::size_t p = 0; p < kFurnaceSide * kFurnaceSide; ++p)
        sum += static_cast<double>(sums[p * channels + c]);
      return std::ldexp(sum, -scale) / (kFurnaceSide * kFurnaceSide * kBatchIterations);
    };
    for (std::uint32_t c = 0; c < 3; ++c) {
      result.film[c].push_back(mean(output.film->sums(), 3, c, state.film_scale_log2));
      result.albedo[c].push_back(mean(output.aovs[0]->sums(), 3, c, output.aovs[0]->spec().scale_log2));
    }
    result.coverage[0].push_back(mean(output.aovs[1]->sums(), 1, 0, output.aovs[1]->spec().scale_log2));
  }
  return result;
}

void expect_near(const std::vector<double>& differences, const std::string& what) {
  const Moments moments = moments_of(differences);
  const double error = std::sqrt(moments.variance_of_mean());
  EXPECT_LE(std::abs(moments.mean()), 5 * error + 1e-6) << what << ": " << moments.mean() << " +- " << error;
}

TEST(Aov, AlbedoIsTheFurnace) {
  const std::string bodies[] = {
      "<bsdf type='diffuse'><rgb name='reflectance' value='0.2 0.5 0.9'/></bsdf>",
      "<bsdf type='roughconductor'><string name='material' value='Cu'/><float name='alpha' "
      "value='0.3'/></bsdf>",
      "<bsdf type='plastic'><rgb name='diffuse_reflectance' value='0.6 0.2 0.1'/></bsdf>",
      "<bsdf type='roughplastic'><rgb name='diffuse_reflectance' value='0.1 0.6 0.3'/></bsdf>",
      "<bsdf type='principled'><rgb name='base_color' value='0.7 0.4 0.2'/><float name='roughness' "
      "value='0.4'/><float name='metallic' value='0.3'/></bsdf>",
      "<bsdf type='conductor'><string name='material' value='Au'/></bsdf>",
  };
  for (const std::string& bsdf : bodies) {
    const BatchesOfImage batches = render_batches("<shape type='sphere'>" + bsdf + "</shape>");
    const double albedo = moments_of(batches.albedo[1]).mean();
    EXPECT_GT(albedo, 0.01) << "nothing is tested";
    for (std::size_t c = 0; c < 3; ++c) {
      std::vector<double> differences;
      for (std::size_t b = 0; b < kBatches; ++b)
        differences.push_back(batches.film[c][b] - (1 - batches.coverage[0][b]) - batches.albedo[c][b]);
      expect_near(differences, bsdf + ", channel " + std::to_string(c));
    }
  }
}

// A mask of opacity 1/4 before a plane: the albedo is a quarter of its own and three quarters of the plane's.
TEST(Aov, MasksShowWhatIsBehind) {
  const BatchesOfImage batches = render_batches(
      "<shape type='rectangle'><transform name='to_world'><scale value='9'/></transform><bsdf type='diffuse'>"
      "<rgb name='reflectance' value='0.8 0.4 0'/></bsdf></shape><shape type='rectangle'><transform "
      "name='to_world'><scale value='9'/><translate z='1'/></transform><bsdf type='mask'><float "
      "name='opacity' "
      "value='0.25'/><bsdf type='diffuse'><rgb name='reflectance' value='0 0.4 0.8'/></bsdf></bsdf></shape>");
  const double expected[] = {0.75 * 0.8, 0.4, 0.25 * 0.8};
  for (std::size_t c = 0; c < 3; ++c) {
    std::vector<double> differences;
    for (const double value : batches.albedo[c]) differences.push_back(value - expected[c]);
    expect_near(differences, "channel " + std::to_string(c));
  }
  for (const double coverage : batches.coverage[0]) EXPECT_NEAR(coverage, 1, 1e-12);
}

}  // namespace
}  // namespace candela::statistical
