// Tests of the noise of a comparison: standard errors of its figures, and blocks that differ.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "common/rng/stream.h"
#include "common/stats/image_difference.h"

namespace candela::stats {
namespace {

constexpr std::uint32_t kWidth = 56, kHeight = 40;  // 12 blocks, some of them cut
constexpr std::size_t kValues = std::size_t{kWidth} * kHeight * 3;

struct Image {
  std::vector<float> values, variance;
};

// Means of values from 0.1 to 1; 16 exponential samples each, in two halves. The channels of a pixel are one.
Image render(std::uint64_t seed, double scale = 1) {
  Image image;
  rng::Stream stream(rng::key(seed, 0, 0));
  for (std::size_t p = 0; p < kValues / 3; ++p) {
    const double mean = scale * (0.1 + 0.9 * static_cast<double>(p % 10) / 9);
    double half[2] = {0, 0};
    for (double& sum : half) {
      double product = 1;
      for (int i = 0; i < 8; ++i) product *= 1 - stream.next_float();
      sum = -mean * std::log(product) / 8;
    }
    for (int c = 0; c < 3; ++c) {
      image.values.push_back(static_cast<float>((half[0] + half[1]) / 2));
      image.variance.push_back(static_cast<float>((half[0] - half[1]) * (half[0] - half[1]) / 4));
    }
  }
  return image;
}

// Without noise.
Image means() {
  Image image;
  for (std::size_t i = 0; i < kValues; ++i)
    image.values.push_back(static_cast<float>(0.1 + 0.9 * static_cast<double>(i / 3 % 10) / 9));
  image.variance.resize(kValues);
  return image;
}

ImageDifference difference_of(const Image& a, const Image& b) {
  return difference(a.values, a.variance, b.values, b.variance, kWidth, kHeight);
}

// Claim: images of one mean have a differing block at p < 0.01 in at most one pair of a hundred: of 300
// pairs, 11 or more would come by chance in 3e-4 of all draws of seeds.
TEST(ImageDifference, EqualMeansSeldomAlarm) {
  int alarms = 0;
  for (std::uint64_t pair = 0; pair < 300; ++pair) {
    const ImageDifference d = difference_of(render(2 * pair), render(2 * pair + 1));
    EXPECT_EQ(d.blocks, 12U);
    alarms += d.differing.empty() ? 0 : 1;
  }
  EXPECT_LT(alarms, 11);
}

// Claim: a block that is 12 % brighter (8 standard errors) is found, at its place, and no other.
TEST(ImageDifference, ABrighterBlockIsFound) {
  Image a = render(1), b = render(2);
  for (std::uint32_t y = 32; y < 40; ++y)
    for (std::uint32_t x = 48; x < 56; ++x)
      for (std::uint32_t c = 0; c < 3; ++c) a.values[(y * kWidth + x) * 3 + c] *= 1.5F;
  const ImageDifference d = difference_of(a, b);
  ASSERT_EQ(d.differing.size(), 1U);
  EXPECT_EQ(d.differing[0].x, 48U);
  EXPECT_EQ(d.differing[0].y, 32U);
  EXPECT_EQ(d.differing[0].width, 8U);
  EXPECT_EQ(d.differing[0].height, 8U);
  EXPECT_LT(d.differing[0].p, 1e-4);
  EXPECT_GT(d.differing[0].a[0], 1.3 * d.differing[0].b[0]);
}

// Claim: figures spread over 150 pairs as their standard errors say, and relMSE of an image beside the means
// themselves is what is expected of noise.
TEST(ImageDifference, StandardErrorsAreThoseOfTheFigures) {
  struct Spread {
    double sum = 0, squares = 0, errors = 0;
    int count = 0;
    void add(double value, double error) {
      sum += value;
      squares += value * value;
      errors += error * error;
      ++count;
    }
    double mean() const { return sum / count; }
    double deviation() const { return std::sqrt(squares / count - mean() * mean()); }
    double shown() const { return std::sqrt(errors / count); }
  } mean, ratio, rmse, relmse, excess;
  const Image exact = means();
  for (std::uint64_t pair = 0; pair < 150; ++pair) {
    const Image a = render(2 * pair, 1.1), b = render(2 * pair + 1);
    const ImageComparison c = compare(a.values, b.values, kWidth, kHeight, 0);
    const ImageDifference d = difference_of(a, b);
    mean.add(c.mean_a, d.noise.mean_a);
    ratio.add(c.mean_ratio, d.noise.mean_ratio);
    rmse.add(c.rmse, d.noise.rmse);
    relmse.add(c.relmse, d.noise.relmse);
    excess.add(compare(b.values, exact.values, kWidth, kHeight, 0).relmse -
                   difference_of(b, exact).noise.expected_relmse,
               0);
  }
  EXPECT_NEAR(mean.shown() / mean.deviation(), 1, 0.25);
  EXPECT_NEAR(ratio.shown() / ratio.deviation(), 1, 0.25);
  // The formula is made for normal values; of skewed ones it is too wide.
  EXPECT_NEAR(rmse.shown() / rmse.deviation(), 1.2, 0.35);
  EXPECT_NEAR(relmse.shown() / relmse.deviation(), 1, 0.4);
  EXPECT_LT(std::fabs(excess.mean()), 0.01 * relmse.mean()) << excess.mean() << " of " << relmse.mean();
}

// Claim: without variance any difference is one, and none is none.
TEST(ImageDifference, WithoutVarianceAnyDifferenceCounts) {
  Image a = render(1);
  EXPECT_TRUE(difference(a.values, {}, a.values, {}, kWidth, kHeight).differing.empty());
  Image b = a;
  b.values[0] += 1e-3F;
  const ImageDifference d = difference(a.values, {}, b.values, {}, kWidth, kHeight);
  ASSERT_EQ(d.differing.size(), 1U);
  EXPECT_EQ(d.differing[0].p, 0);
  EXPECT_EQ(d.noise.relmse, 0);
  b.values[5] = std::nanf("");
  EXPECT_EQ(difference(a.values, {}, b.values, a.variance, kWidth, kHeight).differing[0].p, 0);
}

}  // namespace
}  // namespace candela::stats
