// A small scene for each plugin (gallery/), rendered as the program would, against the thumbnail committed
// beside it. The thumbnail is an 8-bit PNG, so a block's mean is known to within half a code of each of its
// pixels; what differs by more is tested with the variance of our own batches. The false-alarm rate of a
// scene is 1e-4 (Bonferroni over its blocks and channels) for other seeds; the thumbnail's own noise is
// counted as that of its iterations. Tried on the matt ball: 3 % more reflectance in one channel fails, 2 %
// does not.
//
// CANDELA_REWRITE_THUMBNAILS=1 renders the thumbnails instead. Look at them before they are committed.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "client/embedded/commands.h"
#include "client/settings.h"
#include "common/bundle/gather.h"
#include "common/description/vocabulary.h"
#include "common/image/image.h"
#include "tests/paths.h"
#include "tests/proofs/proofs.h"
#include "tests/statistical/harness.h"
#include "tests/statistical/moments.h"
#include "tests/statistical/quantiles.h"

namespace candela::statistical {
namespace {

// Films decide these tests: proofs.h.
const proofs::FilmsDecide kFilms({"Gallery"});

namespace fs = std::filesystem;

constexpr std::size_t kBatches = 16;
constexpr std::uint64_t kIterations = 4;
constexpr std::size_t kThumbnailBatches = 16;
constexpr std::uint64_t kThumbnailIterations = 16;
constexpr std::uint32_t kBlock = 12;

fs::path gallery() {
  return test::source_path("tests/statistical/gallery");
}

std::vector<std::string> scene_names() {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(gallery()))
    if (entry.path().extension() == ".xml") names.push_back(entry.path().stem().string());
  std::sort(names.begin(), names.end());
  return names;
}

TestScene load(const std::string& name) {
  client::SceneOptions options;
  options.scene = (gallery() / (name + ".xml")).string();
  const auto loaded = client::load_scene(options, client::renderer_facts());
  if (!loaded.ok()) throw std::runtime_error(loaded.error().to_string());
  TestScene scene;
  scene.files = std::make_shared<bundle::DiskSource>(gallery());
  scene.main_key = name + ".xml";
  scene.settings = loaded->job.settings;
  return scene;
}

// The mean over batches.
std::vector<float> mean_of(const std::vector<std::vector<float>>& batches) {
  std::vector<double> sum(batches[0].size());
  for (const auto& batch : batches)
    for (std::size_t i = 0; i < batch.size(); ++i) sum[i] += static_cast<double>(batch[i]);
  std::vector<float> mean(sum.size());
  for (std::size_t i = 0; i < sum.size(); ++i)
    mean[i] = static_cast<float>(sum[i] / static_cast<double>(batches.size()));
  return mean;
}

// How far a linear value may be from that of its 8-bit code: the wider half of the code's interval.
double half_code(double linear) {
  const float code = image::linear_to_srgb(static_cast<float>(linear));
  const float step = 0.5f / 255;
  return static_cast<double>(image::srgb_to_linear(code + step)) - linear;
}

class Gallery : public testing::TestWithParam<std::string> {};

TEST_P(Gallery, LooksAsItsThumbnail) {
  const TestScene scene = load(GetParam());
  const fs::path thumbnail_path = gallery() / (GetParam() + ".png");
  const std::uint32_t width = scene.settings.width, height = scene.settings.height;
  if (std::getenv("CANDELA_REWRITE_THUMBNAILS") != nullptr) {
    image::Image image{
        width, height, mean_of(render_batches(scene, 1, kThumbnailBatches, kThumbnailIterations)), {}};
    const auto png = image::encode_png(image);
    ASSERT_TRUE(png.ok()) << png.error().to_string();
    std::ofstream(thumbnail_path, std::ios::binary) << *png;
    GTEST_SKIP() << "wrote " << thumbnail_path;
  }
  const auto thumbnail = image::read_image(thumbnail_path);
  ASSERT_TRUE(thumbnail.ok()) << thumbnail.error().to_string();
  ASSERT_EQ(thumbnail->width, width);
  ASSERT_EQ(thumbnail->height, height);

  const auto batches = render_batches(scene, 1001, kBatches, kIterations);
  constexpr double kOwn = static_cast<double>(kBatches) * kIterations;
  constexpr double kThumbnail = static_cast<double>(kThumbnailBatches) * kThumbnailIterations;
  std::size_t tested = 0, clipped = 0;
  double smallest_p = 1, largest_deviation = 0;
  std::string worst;
  for (std::uint32_t by = 0; by < height; by += kBlock) {
    for (std::uint32_t bx = 0; bx < width; bx += kBlock) {
      for (std::uint32_t channel = 0; channel < 3; ++channel) {
        std::vector<double> means(kBatches, 0.0);
        double expected = 0, rounding = 0, pixels = 0;
        bool clips = false;
        for (std::uint32_t y = by; y < std::min(by + kBlock, height); ++y) {
          for (std::uint32_t x = bx; x < std::min(bx + kBlock, width); ++x) {
            const std::size_t i = (std::size_t{y} * width + x) * 3 + channel;
            const auto value = static_cast<double>(thumbnail->rgb[i]);
            // Clipped pixels say nothing: white ones, and black ones under filters with negative lobes.
            clips = clips || value > 0.99 || value <= 0;
            expected += value;
            rounding += half_code(value);
            for (std::size_t k = 0; k < kBatches; ++k) means[k] += static_cast<double>(batches[k][i]);
            pixels += 1;
          }
        }
        if (clips) {
          ++clipped;
          continue;
        }
        Moments own;
        for (const double value : means) own.add(value / pixels);
        const double mean = own.mean();
        const double variance = own.variance_of_mean() * (1 + kOwn / kThumbnail) + 1e-12 * mean * mean;
        const double beyond = std::max(0.0, std::fabs(mean - expected / pixels) - rounding / pixels);
        const double p = student_two_sided(t_statistic(beyond, std::sqrt(variance)), own.freedom());
        ++tested;
        largest_deviation = std::max(largest_deviation, std::sqrt(variance) / mean);
        if (p < smallest_p) {
          smallest_p = p;
          worst = "block at (" + std::to_string(bx) + ", " + std::to_string(by) + "), channel " +
                  std::to_string(channel) + ": " + std::to_string(mean) + " against " +
                  std::to_string(expected / pixels) + ", standard error " +
                  std::to_string(std::sqrt(variance));
        }
      }
    }
  }
  std::printf("%s: %zu values tested, %zu clipped, largest relative standard error %.2e, smallest p %.2e\n",
              GetParam().c_str(), tested, clipped, largest_deviation, smallest_p);
  // Most of the picture is comparable.
  EXPECT_GT(tested, clipped);
  EXPECT_GT(smallest_p * static_cast<double>(tested), 1e-4) << worst;
}

INSTANTIATE_TEST_SUITE_P(Scenes, Gallery, testing::ValuesIn(scene_names()), [](const auto& param_info) {
  std::string name = param_info.param;
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
});

// Claim: every plugin of the vocabulary that shapes a picture has its scene here.
TEST(GalleryIsComplete, EveryPluginIsUsed) {
  std::string all;
  for (const auto& entry : fs::recursive_directory_iterator(gallery())) {
    if (entry.path().extension() != ".xml") continue;
    std::ifstream in(entry.path());
    all.append(std::istreambuf_iterator<char>(in), {});
  }
  for (const description::PluginRule& rule : description::vocabulary()) {
    // Integrators are tested by name on scenes of their own (test_integrators.cpp).
    if (rule.name.empty() || rule.category == "sampler" || rule.category == "integrator") continue;
    const std::string use = "<" + std::string(rule.category) + " type=\"" + std::string(rule.name) + "\"";
    EXPECT_NE(all.find(use), std::string::npos) << "no scene of the gallery has " << use;
  }
}

}  // namespace
}  // namespace candela::statistical
