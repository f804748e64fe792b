// Trained light selection of optimis in the full renderer, over epochs.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/epoch_run.h"
#include "tests/statistical/harness.h"

namespace candela::statistical {
namespace {

// Two equal lamps over a floor; a plate hides one of them from all of it.
const std::string kHalfHidden =
    R"(<scene version="3.0.0"><integrator type="path"/>
    <sensor type="perspective"><float name="fov" value="40"/><transform name="to_world"><lookat origin="0,-2,3" target="0,0,0" up="0,0,1"/></transform></sensor>
    <shape type="rectangle"><transform name="to_world"><scale value="2"/></transform></shape>
    <shape type="sphere"><point name="center" x="-0.7" y="0" z="1.5"/><float name="radius" value="0.05"/><emitter type="area"/></shape>
    <shape type="sphere"><point name="center" x="0.7" y="0" z="1.5"/><float name="radius" value="0.05"/><emitter type="area"/></shape>
    <shape type="rectangle"><transform name="to_world"><scale value="0.4"/><translate x="0.7" y="0" z="1.3"/></transform><bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf></shape></scene>)";

// The same of two fields of 50 lamps, one of them over a plate.
std::string field_half_hidden() {
  std::string xml = kHalfHidden.substr(0, kHalfHidden.find("<shape type=\"sphere\">"));
  for (int i = 0; i < 100; ++i)
    xml += fmt::format(
        R"(<shape type="sphere"><point name="center" x="{}" y="{}" z="1.5"/><float name="radius" value="0.02"/><emitter type="area"/></shape>)",
        0.2 * (i % 10) - 0.9, 0.2 * (i / 10) - 0.9);
  return xml +
         R"(<shape type="rectangle"><transform name="to_world"><scale x="0.6" y="1.1"/><translate x="0.6" y="0" z="1.4"/></transform><bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf></shape></scene>)";
}

constexpr std::uint32_t kSide = 16, kBlocks = 4;
constexpr std::size_t kJobs = 24;
constexpr std::uint64_t kIterations = 96;

struct Blocks {
  std::vector<double> mean = std::vector<double>(kBlocks * kBlocks),
                      variance = std::vector<double>(kBlocks * kBlocks);
};
Blocks blocks(const std::string& xml, const std::string& selection, std::uint64_t seed) {
  TestScene scene = scene_from_xml(xml, kSide, kSide);
  scene.settings.sampler = "independent";
  scene = with_integrator(std::move(scene), "optimis",
                          {{"selection", selection},
                           {"techniques", "light"},
                           {"weights", "balance"},
                           {"depth", "direct"},
                           {"hide_emitters", "true"}});
  std::vector<std::vector<double>> images;
  for (std::size_t job = 0; job < kJobs; ++job) {
    scene.settings.seed = seed + job;
    const auto renderer = make_renderer(scene);
    const auto pilot = renderer->pilot({});
    if (!pilot.ok()) throw std::runtime_error(pilot.error().to_string());
    auto sums = test::render_job(*renderer, *pilot, kIterations, {});
    if (!sums.ok()) throw std::runtime_error(sums.error().to_string());
    EXPECT_EQ(sums->states.empty(), selection != "trained");
    images.push_back(sums->mean(0));
  }
  Blocks out;
  for (std::size_t block = 0; block < out.mean.size(); ++block) {
    double sum = 0, squares = 0;
    for (const auto& image : images) {
      double value = 0;
      for (std::uint32_t y = 0; y < kSide / kBlocks; ++y)
        for (std::uint32_t x = 0; x < kSide / kBlocks; ++x)
          value += image[3 * ((block / kBlocks * (kSide / kBlocks) + y) * kSide +
                              block % kBlocks * (kSide / kBlocks) + x) +
                         1];
      sum += value;
      squares += value * value;
    }
    out.mean[block] = sum / kJobs;
    out.variance[block] = (squares - sum * sum / kJobs) / (kJobs - 1);
  }
  return out;
}

// Claim: an image by trained selection has the mean of the one by contribution (t test of 24 + 24 jobs in 16
// blocks, 46 degrees of freedom, |t| < 5.6: 4e-5 over both scenes), also where the choice is untrained, of
// short jobs of the same epochs; and where lamps are hidden from most points, of two lamps or of two fields
// whose lamps share weights, it has less than 0.8 of the variance.
TEST(OptimisTrained, IsUnbiasedAndLearnsWhatIsHidden) {
  for (const std::string& xml : {kHalfHidden, field_half_hidden()}) {
    const Blocks trained = blocks(xml, "trained", 100), contribution = blocks(xml, "contribution", 900);
    double variance = 0, of_contribution = 0;
    for (std::size_t block = 0; block < kBlocks * kBlocks; ++block) {
      variance += trained.variance[block];
      of_contribution += contribution.variance[block];
      const double error = std::sqrt((trained.variance[block] + contribution.variance[block]) / kJobs);
      EXPECT_NEAR(trained.mean[block], contribution.mean[block], 5.6 * error + 1e-6) << block;
    }
    std::printf("variance of trained over that of contribution: %.3f\n", variance / of_contribution);
    EXPECT_LT(variance, 0.8 * of_contribution);
  }
}

}  // namespace
}  // namespace candela::statistical
