// Tests of the bias that photons measure, on made-up samples and images whose bias is known.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <thread>
#include <utility>
#include <vector>

#include "common/rng/stream.h"
#include "common/stats/error_interval.h"
#include "common/stats/image_error.h"
#include "common/stats/inner_merges.h"
#include "tests/half_images.h"

namespace candela::stats {
namespace {

constexpr std::uint32_t kWidth = 600, kHeight = 300;

film::MergedAccumulator merged_of(const film::UnitAccumulator& unit, std::uint32_t width,
                                  std::uint32_t height) {
  film::MergedAccumulator merged(width, height, unit.spec());
  for (std::uint32_t y = 0; y < merged.height(); ++y)
    for (std::uint32_t x = 0; x < merged.width(); ++x) {
      film::Int128 sums[film::kChannels];
      for (std::size_t c = 0; c < film::kChannels; ++c)
        sums[c] = unit.sums()[(std::size_t{y} * merged.width() + x) * film::kChannels + c];
      merged.set_pixel(x, y, sums);
    }
  return merged;
}

// The difference of image and inner image at a pixel.
std::array<double, film::kChannels> difference_at(std::uint32_t x, std::uint32_t y) {
  const double d = (x < kWidth / 2 ? 0.25 : -0.5) * (1 + y / 3 % 2);
  return {d, 2 * d, 0};
}

// Claim: the bias of a block is twice the mean of the differences of its pixels over the iterations, cut
// blocks at the border included; a half without iterations or sums has none.
TEST(InnerMerges, BiasIsTwiceTheMeanDifference) {
  constexpr int kIterations = 4;
  film::UnitAccumulator unit(kWidth, kHeight, inner_merges_spec(kWidth, kHeight, 30));
  for (std::uint64_t i = 0; i < kIterations; ++i)
    for (std::uint32_t y = 0; y < kHeight; ++y)
      for (std::uint32_t x = 0; x < kWidth; ++x)
        add_inner_merges(unit, kWidth, kHeight, x, y, difference_at(x, y), rng::key(i, y, x));
  const film::MergedAccumulator sums = merged_of(unit, kWidth, kHeight);
  const Movement::Bias bias = measured_bias({&sums, &sums}, kWidth, kHeight, kIterations, 2 * kIterations);
  const std::uint32_t side = block_side(kWidth, kHeight), columns = kWidth / side;
  ASSERT_EQ(side, 3U);
  ASSERT_EQ(bias.a.size(), std::size_t{columns} * (kHeight / side) * film::kChannels);
  for (std::uint32_t y = 0; y < kHeight; y += side)
    for (std::uint32_t x = 0; x < kWidth; x += side)
      for (std::size_t c = 0; c < film::kChannels; ++c) {
        const std::size_t i = (std::size_t{y / side} * columns + x / side) * film::kChannels + c;
        EXPECT_NEAR(bias.a[i], 2 * difference_at(x, y)[c], 1e-6);
        EXPECT_NEAR(bias.b[i], difference_at(x, y)[c], 1e-6);
      }
  EXPECT_TRUE(measured_bias({&sums, &sums}, kWidth, kHeight, 4, 0).a.empty());
  EXPECT_TRUE(measured_bias({&sums, nullptr}, kWidth, kHeight, 4, 4).a.empty());
}

// Claim: threads and the order of samples do not change the sums, also where they share a block; a value that
// is not finite is left out.
TEST(InnerMerges, SumsDoNotDependOnOrder) {
  film::UnitAccumulator one(kWidth, kHeight, inner_merges_spec(kWidth, kHeight, 30)),
      other(kWidth, kHeight, inner_merges_spec(kWidth, kHeight, 30));
  const auto add = [](film::UnitAccumulator& to, std::uint32_t x) {
    for (std::uint32_t y = 0; y < kHeight; ++y) {
      rng::Stream stream(rng::key(5, x, y));
      const double d = stream.next_float() - 0.5;
      add_inner_merges(to, kWidth, kHeight, x, y, {d, d * 3, 1}, rng::key(7, x, y));
    }
  };
  for (std::uint32_t x = 0; x < kWidth; ++x) add(one, x);
  std::thread even([&] {
    for (std::uint32_t x = kWidth; x-- > 0;)
      if (x % 2 == 0) add(other, x);
  });
  for (std::uint32_t x = 1; x < kWidth; x += 2) add(other, x);
  even.join();
  add_inner_merges(other, kWidth, kHeight, 0, 0, {0, std::nan(""), 0}, 1);
  const film::MergedAccumulator a = merged_of(one, kWidth, kHeight), b = merged_of(other, kWidth, kHeight);
  EXPECT_EQ(a.serialise(), b.serialise());
}

// Claim: of a leak along an edge, over which light goes from the bright side to a side eight times as dark,
// and which stays as the iterations grow, the upper end is 0.75 to 1.5 times the truth if it is measured; by
// the movement of the image, which shows none, it is below a fiftieth.
TEST(InnerMerges, ShowLeaksThatStay) {
  constexpr std::uint32_t kEdgePixels = 32;
  constexpr int kSamples = 128;
  const auto truth_at = [](std::size_t p) { return p % kEdgePixels < kEdgePixels / 2 ? 0.125 : 1.0; };
  const auto leak_at = [](std::size_t p) {
    return p % kEdgePixels == kEdgePixels / 2 - 1 ? 0.25 : p % kEdgePixels == kEdgePixels / 2 ? -0.25 : 0;
  };
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    HalfImages image;
    image.width = image.height = kEdgePixels;
    image.n0 = image.n1 = kSamples / 2;
    Movement::Bias measured;
    Movement movement;
    rng::Stream stream(rng::key(seed, 3, 0));
    const auto noise = [&] { return std::sqrt(12.0) * (stream.next_float() - 0.5) / std::sqrt(image.n0); };
    double truth = 0;
    for (std::size_t p = 0; p < std::size_t{kEdgePixels} * kEdgePixels; ++p) {
      double mean = 0;
      for (auto [half, bias] : {std::pair(&image.a, &measured.a), std::pair(&image.b, &measured.b)}) {
        const double value = truth_at(p) + leak_at(p) + 0.2 * truth_at(p) * noise();
        half->insert(half->end(), 3, static_cast<float>(value));
        mean += value / 2;
        // The noise of the difference is root three times as large, and its double measures the bias.
        bias->insert(bias->end(), 3,
                     static_cast<float>(leak_at(p) + 2 * std::sqrt(3.0) * 0.2 * truth_at(p) * noise()));
      }
      const double d = mean - truth_at(p);
      truth += d * d * relative_weight(truth_at(p), 0.5625) / (kEdgePixels * kEdgePixels);
    }
    BlockMeans half_way = error_interval(halves_of(image)).blocks;
    half_way.n0 /= 2;
    half_way.n1 /= 2;
    ErrorContext context{.alpha = 5.0 / 6, .movement = &movement};
    movement.add(half_way, context.alpha);
    EXPECT_LT(error_interval(halves_of(image), context).upper, truth / 50);
    context.measured = &measured;
    const double upper = error_interval(halves_of(image), context).upper;
    EXPECT_GT(upper, 0.75 * truth);
    EXPECT_LT(upper, 1.5 * truth);
  }
}

}  // namespace
}  // namespace candela::stats
