// Images made of very few light paths: what counts a path too many or too few, which nobody would see among
// the millions of a picture, is then off by half the light.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "tests/statistical/moments.h"
#include "tests/unit/renderer_fixture.h"

namespace candela::render {
namespace {

// A matt floor in parallel light, which looks the same everywhere: kernels of any radius have no bias as long
// as they stay on it. Seen: the square of |x|, |y| < 0.6 of the one of 1.
const std::string kScene =
    "<scene version=\"3.0.0\"><integrator type=\"path\"/><sensor type=\"perspective\"><float name=\"fov\" "
    "value=\"33.3984884\"/><string name=\"fov_axis\" value=\"x\"/><transform name=\"to_world\"><lookat "
    "origin=\"0,0,2\" target=\"0,0,0\" up=\"0,1,0\"/></transform></sensor><shape type=\"rectangle\"><bsdf "
    "type=\"diffuse\"><rgb name=\"reflectance\" value=\"0.5\"/></bsdf></shape><emitter "
    "type=\"directional\"><vector "
    "name=\"direction\" x=\"0.6\" y=\"0\" z=\"-0.8\"/><rgb name=\"irradiance\" "
    "value=\"3\"/></emitter></scene>";
constexpr double kRadiance = 0.5 / std::numbers::pi * 3 * 0.8;

constexpr std::uint64_t kBatches = 24, kIterations = 1500;

struct Case {
  std::string integrator;
  std::uint32_t width;
  SettingsMap settings = {};
};

// The mean of the film, over batches with seeds of their own.
statistical::Moments measure(const Case& one) {
  const test::TextFiles files({{"scene.xml", kScene}});
  statistical::Moments mean;
  for (std::uint64_t batch = 0; batch < kBatches; ++batch) {
    JobSettings job;
    job.integrator = one.integrator;
    job.width = one.width;
    job.height = 1;
    job.seed = 100 + batch;
    job.sampler = "independent";
    job.filter = "box";
    const auto renderer = test::make_renderer(files, job, one.settings);
    const auto film = test::render_film(*renderer, kIterations);
    double sum = 0;
    for (std::uint32_t x = 0; x < one.width; ++x) sum += static_cast<double>(film->sums()[3 * x + 1]);
    mean.add(std::ldexp(sum, -test::kFilmScaleLog2) / (one.width * static_cast<double>(kIterations)));
  }
  return mean;
}

// Claim: films of one, two and three pixels, with as many light paths, show the floor as bright as it is. 16
// cases at 6 standard errors of 24 batches (4e-6 each): a false alarm in 7e-5 of seeds. Standard errors are
// at most 2.2 % for ppm and bpm, 1.4 % for light, 0.2 % for bdpt and vcm. Of an image made of one light path
// all of light's, ppm's and bpm's light doubles where one is forgotten.
TEST(LightPaths, FewAreCountedRight) {
  const std::string radius = std::to_string(0.3 / std::numbers::sqrt2);
  std::vector<Case> cases = {{"path", 1}};
  for (const std::uint32_t width : {1U, 2U, 3U}) {
    cases.push_back({"light", width});
    cases.push_back({"bdpt", width, {{"plan", "full"}}});
    cases.push_back({"vcm", width, {{"plan", "full"}, {"radius", radius}}});
    cases.push_back({"ppm", width, {{"radius", radius}, {"alpha", "1"}}});
    cases.push_back({"bpm", width, {{"radius", radius}, {"alpha", "1"}}});
  }
  for (const Case& one : cases) {
    const statistical::Moments mean = measure(one);
    const double ratio = mean.mean() / kRadiance, error = mean.error() / kRadiance;
    std::printf("%s, %u pixels: %.4f +- %.4f\n", one.integrator.c_str(), one.width, ratio, error);
    EXPECT_NEAR(ratio, 1, 6 * error + 1e-3) << one.integrator << ", " << one.width << " pixels";
    EXPECT_LT(error, 0.03) << one.integrator;
  }
}

}  // namespace
}  // namespace candela::render
