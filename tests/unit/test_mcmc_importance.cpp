// Importance of places on the film (worker/mcmc/image_importance.h).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "worker/mcmc/image_importance.h"
#include "worker/mcmc/splat_list.h"

namespace candela::mcmc {
namespace {

constexpr std::uint64_t kSamples = 1600;  // of the first stage

// Claim: cells are few, and each pixel of the film is in one.
TEST(McmcImportance, CellsCoverTheFilm) {
  struct Size {
    std::uint32_t width, height;
  };
  for (const Size size : {Size{1, 1},
                          {3, 7},
                          {16, 16},
                          {256, 256},
                          {257, 143},
                          {1920, 1080},
                          {65536, 1},
                          {1, 65536},
                          {65536, 4096}}) {
    const CoarseGrid grid(size.width, size.height);
    SCOPED_TRACE(testing::Message() << size.width << " x " << size.height);
    EXPECT_LE(grid.cells(), CoarseGrid::kMaxCells);
    EXPECT_GE(grid.extent, CoarseGrid::kMinExtent);
    EXPECT_EQ(grid.cell_of({-3, -3}), 0u);
    EXPECT_EQ(grid.cell_of({1e9f, 1e9f}), grid.cells() - 1);
    double pixels = 0;
    for (std::uint32_t i = 0; i < grid.cells(); ++i) pixels += grid.pixels_of(i);
    EXPECT_EQ(pixels, static_cast<double>(size.width) * size.height);
  }
}

// Claim: importance is the mean over the luminance, with a floor of a tenth of the mean, and between that of
// the cells in between. A black film has none.
TEST(McmcImportance, IsTheInverseOfTheLuminance) {
  const CoarseGrid grid(64, 4);  // 16 cells
  std::vector<double> luminances(16, 0.1);
  std::fill(luminances.begin() + 8, luminances.end(), 1.9);
  const ImageImportance importance = importance_of(grid, luminances, kSamples, 1);
  constexpr double kLevel = 0.03;  // half of a level, relative
  const double dark = 1 / std::sqrt(0.02), bright = 1 / std::sqrt(1.9 * 1.9 + 0.01);
  EXPECT_NEAR(importance.at({2, 2}, 0), dark, kLevel * dark);
  EXPECT_NEAR(importance.at({-5, 9}, 0), importance.at({2, 2}, 0), 1e-12);
  EXPECT_NEAR(importance.at({62, 2}, 0), bright, kLevel * bright);
  double before = importance.at({20, 2}, 0);
  for (float x = 20; x < 44; x += 0.25f) {
    const double here = importance.at({x, 1}, 0);
    EXPECT_LE(here, before * (1 + 1e-12));
    EXPECT_GE(here, before / 1.5) << "a jump at " << x;
    before = here;
  }
  EXPECT_TRUE(importance_of(grid, std::vector<double>(16, 0.0), kSamples, 0).even());
  EXPECT_EQ(ImageImportance().at({3, 3}, 0), 1);
  std::vector<double> lamp(16, 1e-9);
  lamp[3] = 1e9;
  const ImageImportance steep = importance_of(grid, lamp, kSamples, 1);
  for (const std::uint8_t level : steep.levels()) EXPECT_LE(level, ImageImportance::kMaxLevel);
  EXPECT_NEAR(steep.at({60, 2}, 0), 10, 0.3);
  EXPECT_GE(steep.at({14, 2}, 0), 1.0 / 66) << "a chain there must not overflow the film";
}

// Claim: luminance times importance of one splat is at most a sixteenth of the sum over the first stage's
// samples, so that light which it missed cannot outweigh the image; the importance stays above 1/1024.
TEST(McmcImportance, LimitsBrightSplats) {
  const CoarseGrid grid(64, 4);
  std::vector<double> luminances(16, 0.0);
  std::fill(luminances.begin() + 8, luminances.end(), 2.0);
  constexpr double kMean = 3, kMost = kMean * kSamples / 16;
  const ImageImportance importance = importance_of(grid, luminances, kSamples, kMean);
  EXPECT_EQ(importance.max_scalar(), kMost);
  const double dark = importance.at({2, 2}, 0);
  EXPECT_NEAR(dark, 10, 0.3);
  EXPECT_EQ(importance.at({2, 2}, 0.9 * kMost / dark), dark);
  for (const double luminance : {1.1 * kMost / dark, kMost, 50 * kMost})
    EXPECT_DOUBLE_EQ(luminance * importance.at({2, 2}, luminance), kMost);
  EXPECT_EQ(importance.at({2, 2}, 1e30), 1.0 / 1024);
  EXPECT_EQ(importance_of(grid, luminances, 10, kMean).max_scalar(), 32 * kMean) << "of few samples";
  SplatList list(&importance);
  list.add({2, 2}, Spectrum(static_cast<float>(2 * kMost)));
  list.mollify(Spectrum(static_cast<float>(kMost)));
  EXPECT_NEAR(list.scalar(), kMost, 1e-4 * kMost);
  EXPECT_NEAR(list.mollified_scalar(), kMost / 2, 1e-4 * kMost) << "a part has the importance of the whole";
}

// Claim: the scalar contribution of a list is luminance times importance, the mollified part's, too.
TEST(McmcImportance, IsInScalarContributions) {
  const ImageImportance importance(CoarseGrid(8, 4), {144, 96});  // 2, 1/4
  SplatList list(&importance);
  list.add({2, 2}, Spectrum(3));
  list.add({6, 2}, Spectrum(8));
  list.mollify(Spectrum(4));
  EXPECT_NEAR(list.scalar(), 3 * 2 + 8 * 0.25, 1e-6);
  EXPECT_NEAR(list.mollified_scalar(), 4 * 0.25, 1e-6);
  list.sum_again();
  EXPECT_NEAR(list.scalar(), 3 * 2 + 8 * 0.25, 1e-6);
  EXPECT_EQ(list.splats()[1].value.g, 8) << "the film gets what it got";
}

}  // namespace
}  // namespace candela::mcmc
