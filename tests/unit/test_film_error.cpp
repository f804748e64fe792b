// Tests of the figures of error: the comparison with a reference, and the estimate from half films.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "common/film/delta.h"
#include "common/film/unit_film.h"
#include "common/rng/stream.h"
#include "common/stats/image_error.h"

namespace candela::stats {
namespace {

constexpr film::Layout kSmall{24, 16, 1};

// Means of the pixels: bright, dim and black ones.
float mean_of(std::uint32_t x, std::uint32_t c) {
  return x % 4 == 0 ? 0.0F : static_cast<float>(x + c) * 0.1F;
}

// A film of n0 and n1 iterations of exponentially distributed samples: the variance of one is its mean
// squared.
film::MergedFilm render(std::uint64_t seed, std::uint64_t n0, std::uint64_t n1) {
  film::MergedFilm film(kSmall, 24);
  for (std::uint32_t half = 0; half < 2; ++half) {
    const std::uint64_t count = half == 0 ? n0 : n1;
    if (count == 0) continue;
    film::UnitFilm unit(kSmall, 24);
    film::SampleCounts sample_counts;
    for (std::uint64_t i = 0; i < count; ++i) {
      rng::Stream stream(rng::key(seed, half, i));
      for (std::uint32_t y = 0; y < kSmall.height; ++y) {
        for (std::uint32_t x = 0; x < kSmall.width; ++x) {
          std::array<float, 3> rgb{};
          for (std::uint32_t c = 0; c < 3; ++c) rgb[c] = -mean_of(x, c) * std::log(1 - stream.next_float());
          EXPECT_TRUE(unit.add(0, x, y, rgb, rng::key(seed, half, i, y, x), sample_counts));
        }
      }
    }
    film::DeltaInfo info;
    info.unit = {Unit::Kind::iterations, half, 0, count};
    const auto delta = film::Delta::decode(film::encode_delta(unit, info), kSmall);
    EXPECT_TRUE(delta.ok());
    EXPECT_TRUE(film.merge(*delta).ok());
  }
  return film;
}

// Claim: the error is the image's: further layers, however noisy, change neither estimate nor map, and the
// copy of the image alone has the image's sums, counts and iterations.
TEST(EstimateError, LooksAtTheImageAlone) {
  constexpr film::Layout kLayered{kSmall.width, kSmall.height, 3};
  film::MergedFilm plain(kSmall, 24), layered(kLayered, 24);
  for (std::uint32_t half = 0; half < 2; ++half) {
    film::UnitFilm a(kSmall, 24), b(kLayered, 24);
    film::SampleCounts sample_counts;
    rng::Stream stream(rng::key(8, half));
    for (std::uint32_t y = 0; y < kSmall.height; ++y) {
      for (std::uint32_t x = 0; x < kSmall.width; ++x) {
        const float v = stream.next_float();
        a.add(0, x, y, {v, 1, 0}, x, sample_counts);
        b.add(0, x, y, {v, 1, 0}, x, sample_counts);
        for (std::uint32_t layer = 1; layer < 3; ++layer)
          b.splat(layer, x, y, {1000 * stream.next_float(), v, 5}, x, sample_counts);
      }
    }
    sample_counts.eye_samples = 5;
    a.count(sample_counts);
    b.count(sample_counts);
    const Unit unit{Unit::Kind::iterations, half, 0, 2 + half};
    const auto of_a = film::Delta::decode(film::encode_delta(a, {unit, kSmall, 24, "", ""}), kSmall);
    const auto of_b = film::Delta::decode(film::encode_delta(b, {unit, kLayered, 24, "", ""}), kLayered);
    ASSERT_TRUE(of_a.ok() && of_b.ok());
    ASSERT_TRUE(plain.merge(*of_a).ok() && layered.merge(*of_b).ok());
  }
  EXPECT_GT(estimate_error(plain).relmse, 0);
  EXPECT_EQ(estimate_error(plain).relmse, estimate_error(layered).relmse);
  EXPECT_EQ(estimate_error(plain).rmse, estimate_error(layered).rmse);
  EXPECT_EQ(error_map(plain), error_map(layered));
  EXPECT_TRUE(layered.first_layers(1).serialise() == plain.serialise());
}

// Claim: the estimated squared error is unbiased, for equal and unequal halves: its mean over many seeds is
// the true variance of the pooled image, and the mean of the true squared error of the same films. 2 cases x
// 2 comparisons at 5 standard errors (taken from the spread over the seeds): false-alarm rate below 4
// * 5.8e-7 = 2.4e-6.
TEST(EstimateError, IsUnbiased) {
  constexpr int kSeeds = 150;
  double variance = 0;  // of one iteration, mean over the values
  for (std::uint32_t x = 0; x < kSmall.width; ++x) {
    for (std::uint32_t c = 0; c < 3; ++c) variance += std::pow(mean_of(x, c), 2) / (kSmall.width * 3.0);
  }
  for (const auto& [n0, n1] : {std::pair<std::uint64_t, std::uint64_t>{4, 4}, {7, 2}}) {
    const double truth = variance / static_cast<double>(n0 + n1);
    double sum = 0, squares = 0, difference_sum = 0, difference_squares = 0;
    for (int seed = 0; seed < kSeeds; ++seed) {
      const film::MergedFilm film = render(rng::key(5, n0, seed), n0, n1);
      const double estimate = std::pow(estimate_error(film).rmse, 2);
      sum += estimate;
      squares += estimate * estimate;
      const std::vector<float> image = film.develop(0);
      double error = 0;
      for (std::size_t i = 0; i < image.size(); ++i) {
        const double exact = mean_of(static_cast<std::uint32_t>(i / 3 % kSmall.width), i % 3);
        error += std::pow(image[i] - exact, 2) / static_cast<double>(image.size());
      }
      difference_sum += estimate - error;
      difference_squares += (estimate - error) * (estimate - error);
    }
    const auto standard_error = [](double total, double total_squares) {
      const double mean = total / kSeeds;
      return std::sqrt((total_squares / kSeeds - mean * mean) / (kSeeds - 1));
    };
    EXPECT_LT(standard_error(sum, squares), 0.02 * truth);  // the test has power: a bias of 10 % is seen
    EXPECT_LT(std::abs(sum / kSeeds - truth), 5 * standard_error(sum, squares));
    EXPECT_LT(std::abs(difference_sum / kSeeds), 5 * standard_error(difference_sum, difference_squares));
  }
}

// A film of chains with n0 and n1 segments of halves: exponentially distributed, of variance 1. Chains repeat
// what they found in their first segment, or forget it at once.
film::MergedFilm render_chains(std::uint64_t seed, std::uint64_t n0, std::uint64_t n1, bool repeat) {
  constexpr film::Layout kChains{64, 64, 2};
  film::MergedFilm film(kChains, 24);
  for (std::uint32_t half = 0; half < 2; ++half) {
    film::UnitFilm unit(kChains, 24);
    film::SampleCounts sample_counts;
    const std::uint64_t count = half == 0 ? n0 : n1;
    for (std::uint64_t i = 0; i < count; ++i) {
      rng::Stream stream(rng::key(seed, half, repeat ? 0 : i));
      for (std::uint32_t y = 0; y < kChains.height; ++y)
        for (std::uint32_t x = 0; x < kChains.width; ++x) {
          std::array<float, 3> rgb{};
          for (float& value : rgb) value = -std::log(1 - stream.next_float());
          EXPECT_TRUE(unit.splat(0, x, y, rgb, rng::key(seed, half, i, y, x), sample_counts));
        }
    }
    const auto delta = film::Delta::decode(
        film::encode_delta(unit, {{Unit::Kind::segments, half, 0, count}, kChains, 24, "", ""}), kChains);
    EXPECT_TRUE(delta.ok() && film.merge(*delta).ok());
  }
  return film;
}

// Claim: the estimated variance of an image of chains is right for equal halves however a chain's segments
// depend on each other; of unequal ones it is right where they repeat wholly, and by (n0-n1)^2 / 2 n0 n1 of
// itself too large where they are independent: never too small. A - B of two exponentials has kurtosis 6, its
// square a relative standard deviation of 5^(1/2), the mean over 4 films of 12288 values one of 1 %: six of
// these are allowed, and 5 cases alarm falsely with probability below 1e-7.
TEST(EstimateError, OfChainsIsNeverTooSmall) {
  const film::Development development{1, true, 0};
  struct Case {
    std::uint64_t n0, n1;
    bool repeat;
    double too_large;
  };
  for (const Case& c : {Case{4, 4, true, 0}, Case{4, 4, false, 0}, Case{7, 2, true, 0}, Case{2, 7, true, 0},
                        Case{7, 2, false, 25.0 / 28}}) {
    const auto n0 = static_cast<double>(c.n0), n1 = static_cast<double>(c.n1);
    const double truth = c.repeat ? (n0 * n0 + n1 * n1) / ((n0 + n1) * (n0 + n1)) : 1 / (n0 + n1);
    double mean = 0;
    for (std::uint64_t seed = 0; seed < 4; ++seed) {
      const auto film = render_chains(rng::key(9, seed), c.n0, c.n1, c.repeat);
      mean += std::pow(estimate_error(film, development).rmse, 2) / 4;
    }
    EXPECT_NEAR(mean / (truth * (1 + c.too_large)), 1, 0.06) << c.n0 << " " << c.n1 << " " << c.repeat;
  }
}

// Claim: relMSE divides by the pooled mean as documented (recomputed here value by value), and the map is its
// root.
TEST(EstimateError, FollowsItsFormula) {
  const film::MergedFilm film = render(3, 6, 2);
  using Which = film::MergedFilm::Which;
  const auto a = film.develop(0, Which::half0), b = film.develop(0, Which::half1), both = film.develop(0);
  const ErrorEstimate estimate = estimate_error(film);
  double mean = 0;
  for (const float value : both) mean += value / static_cast<double>(both.size());
  EXPECT_NEAR(estimate.mean, mean, 1e-6 * mean);
  double relmse = 0;
  const std::vector<float> map = error_map(film);
  for (std::size_t i = 0; i < both.size(); ++i) {
    EXPECT_NEAR(both[i], (6.0 * a[i] + 2.0 * b[i]) / 8.0, 1e-6 * (a[i] + b[i]));
    const double variance = std::pow(double{a[i]} - b[i], 2) * 12 / 64;
    EXPECT_NEAR(map[i], std::sqrt(variance), 1e-5 * (a[i] + b[i]));
    relmse += variance / (double{both[i]} * both[i] + 0.01 * mean * mean) / static_cast<double>(both.size());
  }
  EXPECT_NEAR(estimate.relmse, relmse, 1e-5 * relmse);
}

// Claim: no estimate without both halves; none of a black film is an error of zero.
TEST(EstimateError, KnowsItsLimits) {
  EXPECT_TRUE(std::isnan(estimate_error(render(1, 0, 0)).relmse));
  EXPECT_TRUE(std::isnan(estimate_error(render(1, 3, 0)).relmse));
  EXPECT_TRUE(std::isnan(error_map(render(1, 0, 3))[7]));
  film::MergedFilm black(kSmall, 24);
  for (std::uint32_t half = 0; half < 2; ++half) {
    film::DeltaInfo info;
    info.unit = {Unit::Kind::iterations, half, 0, 1};
    const auto delta = film::Delta::decode(film::encode_delta(film::UnitFilm(kSmall, 24), info), kSmall);
    ASSERT_TRUE(black.merge(*delta).ok());
  }
  EXPECT_EQ(estimate_error(black).relmse, 0.0);
  EXPECT_EQ(estimate_error(black).rmse, 0.0);
}

// Claim: the figures of a comparison are those of the formulas, worked by hand for a small image.
TEST(Compare, FollowsItsFormulas) {
  const std::vector<float> b{1, 1, 1, 3, 3, 3};
  const std::vector<float> a{1, 1, 1, 3, 3, 6};
  const ImageComparison result = compare(a, b, 2, 1);
  EXPECT_DOUBLE_EQ(result.mean_a, 2.5);
  EXPECT_DOUBLE_EQ(result.mean_b, 2.0);
  EXPECT_DOUBLE_EQ(result.mean_ratio, 1.25);
  EXPECT_DOUBLE_EQ(result.rmse, std::sqrt(9.0 / 6));
  EXPECT_DOUBLE_EQ(result.relmse, 9.0 / (9 + 0.01 * 4) / 6);
  ASSERT_EQ(result.worst.size(), 2U);
  EXPECT_EQ(result.worst[0].x, 1U);
  EXPECT_EQ(result.worst[0].y, 0U);
  EXPECT_DOUBLE_EQ(result.worst[0].relative_squared_error, 9.0 / 9.04 / 3);
  EXPECT_EQ(result.worst[0].a[2], 6.0F);
  EXPECT_EQ(result.worst[0].b[2], 3.0F);
  const ImageComparison same = compare(b, b, 2, 1);
  EXPECT_EQ(same.relmse, 0.0);
  EXPECT_EQ(same.mean_ratio, 1.0);
  const std::vector<float> black(6, 0.0F);
  EXPECT_EQ(compare(black, black, 2, 1).relmse, 0.0);
  EXPECT_TRUE(std::isnan(compare(b, black, 2, 1).mean_ratio));
  EXPECT_TRUE(std::isinf(compare(b, black, 2, 1).relmse));
}

// Claim: trimming drops the worst 0.1 % of the pixels, and pixels that are not finite are infinitely wrong
// and found.
TEST(Compare, TrimsAndFindsOutliers) {
  std::vector<float> b(100 * 20 * 3, 1.0F);
  std::vector<float> a = b;
  a[3 * 1234 + 1] = 1e6F;
  a[3 * 77] = std::numeric_limits<float>::quiet_NaN();
  const ImageComparison result = compare(a, b, 100, 20, 3);
  EXPECT_TRUE(std::isinf(result.relmse));
  EXPECT_TRUE(std::isinf(result.rmse));
  EXPECT_EQ(result.relmse_trimmed, 0.0);  // 2 of 2000 pixels
  ASSERT_EQ(result.worst.size(), 3U);
  EXPECT_EQ(result.worst[0].x, 77U);
  EXPECT_EQ(result.worst[1].x, 34U);
  EXPECT_EQ(result.worst[1].y, 12U);
  EXPECT_EQ(result.worst[2].x, 0U);  // of equals the first
  a[3 * 5] = 2;
  EXPECT_NEAR(compare(a, b, 100, 20).relmse_trimmed, 1 / 1.01 / 3 / 1998, 1e-12);
  b[0] = std::numeric_limits<float>::infinity();
  EXPECT_TRUE(std::isinf(compare(a, b, 100, 20).worst[0].relative_squared_error));
}

}  // namespace
}  // namespace candela::stats
