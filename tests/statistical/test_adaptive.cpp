// Integrators with a radius for each pixel against `bdpt`, block by block: fppm and vcmplus with radii that
// shrink during the job, on light that merging finds (glass, mirrors), on textures, and in fog.
//
// Merging is biased. The first radius is 1 % of the scene's, and what is left of its bias after 32 iterations
// is allowed for: kAllowedBias of a block. A block test at 1e-6 (Bonferroni over its blocks and channels); of
// the eleven of this file one alarms falsely with at most 1.1e-5.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "tests/epoch_run.h"
#include "tests/statistical/harness.h"

namespace candela::statistical {
namespace {

constexpr std::uint32_t kExtent = 48;
constexpr double kAlarm = 1e-6;
constexpr double kAllowedBias = 0.01;

TestScene load(const std::string& name, const std::string& integrator, const SettingsMap& settings = {}) {
  TestScene scene = scene_from_transport(name, kExtent, kExtent);
  scene.settings.sampler = "independent";
  return with_integrator(std::move(scene), integrator, settings);
}

class AdaptiveRadii : public testing::TestWithParam<std::string> {};

// Claim: pictures of fppm and vcmplus, in fog those of appm, are those of bdpt, and radii have shrunk
// meanwhile.
TEST_P(AdaptiveRadii, AgreeWithBdpt) {
  const auto truth = render_batches(load(GetParam(), "bdpt"), 1, 12, 64);
  std::vector<float> mean(truth[0].size()), error(truth[0].size());
  for (std::size_t i = 0; i < mean.size(); ++i) {
    double sum = 0, squares = 0;
    for (const auto& image : truth) {
      sum += static_cast<double>(image[i]);
      squares += static_cast<double>(image[i]) * static_cast<double>(image[i]);
    }
    const auto n = static_cast<double>(truth.size());
    mean[i] = static_cast<float>(sum / n);
    error[i] = static_cast<float>(std::sqrt(std::max(0.0, squares / n - sum / n * (sum / n)) / (n - 1)));
  }
  std::vector<std::string> integrators = {"fppm", "vcmplus"};
  if (GetParam() == "fog-thin") integrators.emplace_back("appm");
  for (const std::string& integrator : integrators) {
    SettingsMap settings = {{"radius", "0.01"}};
    if (integrator != "appm") settings["alpha_f"] = "0.05";
    const TestScene scene = load(GetParam(), integrator, settings);
    BlockTestOptions options;
    options.allowed_bias = kAllowedBias;
    options.max_relative_error = 0.1;
    const auto result = block_test(render_batches(scene, 100, 8, 32), mean, error, kExtent, kExtent, options);
    std::printf("%s %s: ratio %.4f +- %.4f, %zu values tested, %zu skipped, p %.2g\n", GetParam().c_str(),
                integrator.c_str(), result.ratio, result.ratio_stderr, result.tested, result.skipped,
                result.adjusted_p);
    EXPECT_GT(result.adjusted_p, kAlarm) << integrator << ": " << result.worst;
    EXPECT_GT(result.tested, result.skipped) << integrator;

    const auto renderer = make_renderer(scene);
    const auto pilot = renderer->pilot({});
    ASSERT_TRUE(pilot.ok()) << pilot.error().to_string();
    if (!pilot->work.epochs) continue;  // the plan merges nothing
    const auto job = test::render_job(*renderer, *pilot, 32, {});
    ASSERT_TRUE(job.ok()) << job.error().to_string();
    const std::string& map = job->states.back();
    EXPECT_TRUE(std::any_of(map.begin(), map.end(), [](char level) { return level != 0; })) << integrator;
  }
}
INSTANTIATE_TEST_SUITE_P(Scenes, AdaptiveRadii,
                         testing::Values("box-diffuse", "textured-lamp", "mixed", "lamp-in-glass",
                                         "fog-thin"),
                         [](const auto& test) {
                           std::string name = test.param;
                           std::replace(name.begin(), name.end(), '-', '_');
                           return name;
                         });

}  // namespace
}  // namespace candela::statistical
