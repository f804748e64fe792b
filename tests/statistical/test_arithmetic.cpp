// The arithmetic of the statistical tests (moments.h, quantiles.h, batch_means.h, extrapolation.h): against
// textbook values, sums written out, and processes whose laws are known. Random tests state their false-alarm
// rate each.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "common/rng/stream.h"
#include "tests/statistical/batch_means.h"
#include "tests/statistical/extrapolation.h"
#include "tests/statistical/moments.h"
#include "tests/statistical/quantiles.h"

namespace candela::statistical {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

double normal(rng::Stream& stream) {
  return normal_quantile(std::ldexp(static_cast<double>(stream.next_u32()) + 0.5, -32));
}

// Claim: mean, variance and skewness are those of the formulas written out, also where the mean is 10^8
// standard deviations, and however the numbers are cut into sets that are merged.
TEST(Moments, AreTheFormulas) {
  rng::Stream stream(1);
  for (const double offset : {0.0, 1e8}) {
    std::vector<double> numbers;
    for (int i = 0; i < 1000; ++i)
      numbers.push_back(offset + std::round(std::exp(2 * normal(stream)) * 1024) / 1024);
    long double mean = 0, second = 0, third = 0;
    for (const double x : numbers) mean += x / 1000.0L;
    for (const double x : numbers) {
      const long double d = x - mean;
      second += d * d;
      third += d * d * d;
    }
    const auto variance = static_cast<double>(second / 999);
    const auto skewness = static_cast<double>(third / 1000 / powl(second / 1000, 1.5L));
    const auto check = [&](const Moments& m) {
      EXPECT_EQ(m.count(), 1000U);
      EXPECT_EQ(m.freedom(), 999);
      EXPECT_NEAR(m.mean(), static_cast<double>(mean), 1e-12 * (1 + offset));
      EXPECT_NEAR(m.variance() / variance, 1, 1e-8);
      EXPECT_NEAR(m.variance_of_mean() * 1000 / variance, 1, 1e-8);
      EXPECT_NEAR(m.error() * m.error() * 1000 / variance, 1, 1e-8);
      EXPECT_NEAR(m.skewness() / skewness, 1, 1e-7);
    };
    check(moments_of(numbers));
    for (const std::size_t part : {1U, 7U, 400U, 999U, 5000U}) {
      Moments all;
      for (std::size_t i = 0; i < numbers.size(); i += part)
        all.merge(moments_of(std::span(numbers).subspan(i, std::min(part, numbers.size() - i))));
      check(all);
    }
  }
}

// Claim: what is said of sets without variance, of one number and of none; nothing of it is NaN.
TEST(Moments, DegenerateSets) {
  Moments none, one, same;
  one.add(3);
  for (int i = 0; i < 5; ++i) same.add(0.1);
  EXPECT_EQ(none.mean(), 0);
  EXPECT_EQ(one.mean(), 3);
  for (const Moments& m : {none, one}) {
    EXPECT_EQ(m.freedom(), 0);
    EXPECT_EQ(m.variance(), 0);
    EXPECT_EQ(m.error(), 0);
    EXPECT_EQ(m.skewness(), 0);
  }
  EXPECT_EQ(same.mean(), 0.1);
  EXPECT_EQ(same.variance(), 0);
  EXPECT_EQ(same.freedom(), 4);
  none.merge(one);
  EXPECT_EQ(none.mean(), 3);
  EXPECT_EQ(none.count(), 1U);
  none.merge(Moments());
  EXPECT_EQ(none.count(), 1U);
  // Of one number all known of it is nothing: no p-value below 1.
  EXPECT_EQ(student_two_sided(t_statistic(7, one.error()), one.freedom()), 1);
}

// Claim: relMSE to be expected of an image, by hand: values 1 and 3 of variance 2 and 0 over two images.
TEST(Moments, OfImages) {
  ImageMoments moments;
  add_image(moments, std::vector<float>{0, 3});
  add_image(moments, std::vector<float>{2, 3});
  EXPECT_DOUBLE_EQ(relative_variance(moments), (1 / (1 + 0.01 * 4)) / 2);
  ImageMoments black;
  for (int i = 0; i < 3; ++i) add_image(black, std::vector<float>{0, 0});
  EXPECT_EQ(relative_variance(black), 0);
}

// Claim: tables printed in textbooks (three to five digits), quantiles far out as the inverses of tails, and
// identities between the laws.
TEST(Quantiles, AreThoseOfTheTables) {
  EXPECT_NEAR(normal_quantile(0.025), 1.95996, 5e-6);
  EXPECT_NEAR(student_quantile(0.025, 1), 12.706, 5e-4);
  EXPECT_NEAR(student_quantile(0.025, 10), 2.228, 5e-4);
  EXPECT_NEAR(student_quantile(0.005, 30), 2.750, 5e-4);
  EXPECT_NEAR(chi_squared_quantile(0.05, 1), 3.841, 5e-4);
  EXPECT_NEAR(chi_squared_quantile(0.05, 10), 18.307, 5e-4);
  EXPECT_NEAR(chi_squared_quantile(0.95, 10), 3.940, 5e-4);
  EXPECT_NEAR(fisher_quantile(0.05, 5, 10), 3.33, 5e-3);
  EXPECT_NEAR(fisher_quantile(0.01, 10, 5), 10.05, 5e-3);
  // In closed form.
  EXPECT_NEAR(student_tail(1, 1), 0.25, 1e-15);
  EXPECT_NEAR(chi_squared_tail(7, 2), std::exp(-3.5), 1e-15);
  EXPECT_NEAR(fisher_tail(3, 2, 2), 0.25, 1e-15);
  for (const double tail : {0.9, 0.5, 1e-2, 1e-5, 1e-12})
    for (const double n : {1.0, 2.5, 15.0, 1e4}) {
      EXPECT_NEAR(normal_tail(normal_quantile(tail)) / tail, 1, 1e-9);
      EXPECT_NEAR(student_tail(student_quantile(tail, n), n) / tail, 1, 1e-9);
      EXPECT_NEAR(chi_squared_tail(chi_squared_quantile(tail, n), n) / tail, 1, 1e-9);
      EXPECT_NEAR(fisher_tail(fisher_quantile(tail, n, 7), n, 7) / tail, 1, 1e-9);
      // t^2 is F of 1 and n, and chi-squared over n is F against a variance that is known.
      const double t = student_quantile(tail / 2, n);
      EXPECT_NEAR(student_two_sided(-t, n) / tail, 1, 1e-9);
      EXPECT_NEAR(fisher_tail(t * t, 1, n) / tail, 1, 1e-9);
      EXPECT_DOUBLE_EQ(fisher_quantile(tail, n, kInfinity), chi_squared_quantile(tail, n) / n);
      EXPECT_NEAR(fisher_tail(fisher_quantile(tail, kInfinity, n), kInfinity, n) / tail, 1, 1e-9);
      EXPECT_NEAR(fisher_two_sided(2, n, 7), fisher_two_sided(0.5, 7, n), 1e-15);
    }
}

// Claim: one sample, no variance, known variance, and NaN: what the header says of them.
TEST(Quantiles, DegenerateCases) {
  const double nan = std::nan("");
  for (const double t : {-kInfinity, -3.0, 0.0, 3.0, kInfinity}) {
    EXPECT_EQ(student_tail(t, 0), 0.5);
    EXPECT_EQ(student_two_sided(t, 0), 1);
    EXPECT_NEAR(student_tail(t, kInfinity), normal_tail(t), 1e-15);
    EXPECT_EQ(fisher_tail(t, 0, 5), 1);
    EXPECT_EQ(fisher_tail(t, 5, 0), 1);
  }
  EXPECT_EQ(student_tail(kInfinity, 3), 0);
  EXPECT_EQ(student_tail(-kInfinity, 3), 1);
  EXPECT_EQ(student_quantile(0.01, 0), kInfinity);
  EXPECT_EQ(student_quantile(0.99, 0), -kInfinity);
  EXPECT_EQ(student_quantile(0.01, kInfinity), normal_quantile(0.01));
  EXPECT_EQ(student_quantile(0, 5), kInfinity);
  EXPECT_EQ(student_quantile(0.5, 5), 0);
  EXPECT_EQ(chi_squared_tail(0, 0), 1);
  EXPECT_EQ(chi_squared_tail(1, 0), 0);
  EXPECT_EQ(chi_squared_tail(kInfinity, 3), 0);
  EXPECT_EQ(chi_squared_quantile(0.01, 0), 0);
  EXPECT_EQ(chi_squared_quantile(0, 2), kInfinity);
  EXPECT_EQ(fisher_quantile(0.01, 3, 0), kInfinity);
  EXPECT_EQ(fisher_quantile(0.01, kInfinity, kInfinity), 1);
  EXPECT_EQ(fisher_two_sided(0, 3, 3), 0);
  EXPECT_EQ(fisher_two_sided(1, kInfinity, kInfinity), 1);
  EXPECT_EQ(t_statistic(0, 0), 0);
  EXPECT_EQ(t_statistic(-1, 0), -kInfinity);
  EXPECT_EQ(variance_ratio(0, 0), 1);
  EXPECT_EQ(variance_ratio(2, 0), kInfinity);
  EXPECT_EQ(variance_ratio(0, 2), 0);
  for (const double unknown :
       {normal_tail(nan), normal_quantile(nan), student_tail(nan, 3), student_tail(1, nan),
        student_quantile(nan, 3), chi_squared_tail(nan, 3), chi_squared_quantile(nan, 3),
        fisher_tail(nan, 3, 3), fisher_two_sided(nan, 3, 3), t_statistic(1, nan), variance_ratio(nan, 0)})
    EXPECT_TRUE(std::isnan(unknown));
}

// Claim: Welch's and Satterthwaite's degrees of freedom, by hand; what is known adds none, what is not known
// takes all.
TEST(Quantiles, FreedomOfSums) {
  const EstimatedVariance a{2, 9}, b{6, 3}, known{1, kInfinity}, nothing{0, 0}, unknown{1, 0};
  EXPECT_DOUBLE_EQ((a + b).variance, 8);
  EXPECT_DOUBLE_EQ((a + b).freedom, 64 / (4.0 / 9 + 36.0 / 3));
  EXPECT_DOUBLE_EQ((a + b + known).freedom, 81 / (4.0 / 9 + 36.0 / 3));
  EXPECT_DOUBLE_EQ((a + nothing).freedom, 9);
  EXPECT_EQ((nothing + nothing).freedom, kInfinity);
  EXPECT_EQ((a + unknown).freedom, 0);
  const EstimatedVariance tiny{1e-200, 4};
  EXPECT_DOUBLE_EQ((tiny + tiny).freedom, 8);
}

// x_i = rho x_{i-1} + noise, of variance 1: the mean of n has, for n long, the variance (1 + rho) / (1 - rho)
// / n.
std::vector<double> autoregressive(rng::Stream& stream, double rho, std::size_t n) {
  std::vector<double> series{normal(stream)};
  while (series.size() < n) series.push_back(rho * series.back() + std::sqrt(1 - rho * rho) * normal(stream));
  return series;
}

// Claim: of a series of known autocorrelation the error by batch means is the true one, and the effective
// number of members n (1 - rho) / (1 + rho). Of 200 series of 20,000 in 20 batches the mean squared error has
// a relative standard deviation of sqrt(2 / 3800) = 2.3 %: four of them, and 2 % for what batches of 1000
// leave out (at most 2 rho / (1 - rho^2) of 1000: 0.9 %). Three cases, two values each: a false alarm in 4e-4
// of seeds. Members taken for independent ones would be off by a factor of 19 for rho = 0.9.
TEST(BatchMeans, OfAnAutoregressiveSeries) {
  constexpr std::size_t kLength = 20000, kSeries = 200;
  for (const double rho : {-0.5, 0.0, 0.9}) {
    rng::Stream stream(static_cast<std::uint64_t>(10 + 10 * rho));
    Moments squared_errors, effective;
    std::size_t covered = 0;
    for (std::size_t i = 0; i < kSeries; ++i) {
      const BatchMeans found = batch_means(autoregressive(stream, rho, kLength + 7), 20);
      EXPECT_EQ(found.members.count(), kLength);
      squared_errors.add(found.batches.variance_of_mean());
      effective.add(1 / found.effective());
      covered += student_two_sided(t_statistic(found.batches.mean(), found.batches.error()),
                                   found.batches.freedom()) > 0.05;
    }
    const double truth = (1 + rho) / (1 - rho) / kLength;
    EXPECT_NEAR(squared_errors.mean() / truth, 1, 4 * 0.023 + 0.02) << rho;
    EXPECT_NEAR(effective.mean() * kLength * (1 - rho) / (1 + rho), 1, 4 * 0.024 + 0.02) << rho;
    // Intervals of 95 % hold the mean in 190 of 200; binomial, 1e-4 for either side.
    EXPECT_GE(covered, 177U) << rho;
    EXPECT_LE(covered, 199U) << rho;
  }
}

TEST(BatchMeans, DegenerateSeries) {
  const std::vector<double> same(100, 0.3);
  const BatchMeans still = batch_means(same, 4);
  EXPECT_EQ(still.batches.error(), 0);
  EXPECT_EQ(still.effective(), 100);
  const std::vector<double> two = {1, 2};
  EXPECT_EQ(batch_means(two, 2).batches.mean(), 1.5);
  EXPECT_THROW(batch_means(two, 1), std::invalid_argument);
  EXPECT_THROW(batch_means(two, 3), std::invalid_argument);
}

// Claim: a bias of the order said goes to the last digit, and of the next one what the header says is left.
TEST(Extrapolation, RemovesTheOrderItKnows) {
  for (const double order : {1.0, 2.0, 1.0 / 3})
    for (const double ratio : {2.0, 4.0}) {
      const Extrapolation by = extrapolation(ratio, order);
      EXPECT_DOUBLE_EQ(by.fine + by.coarse, 1);
      const auto value = [&](double h, double next) {
        return 5 + 0.7 * std::pow(h, order) + 0.4 * std::pow(h, next);
      };
      const auto limit = [&](double next) {
        return by.fine * value(0.3 / ratio, next) + by.coarse * value(0.3, next);
      };
      EXPECT_NEAR(limit(order), 5, 1e-14);
      const double next = order + 1;
      const double left = (1 - std::pow(ratio, order - next)) / (1 - std::pow(ratio, order));
      EXPECT_NEAR(limit(next) - 5, left * 0.4 * std::pow(0.3, next), 1e-13);
    }
  const Extrapolation half = over_half_radius();
  EXPECT_DOUBLE_EQ(half.fine, 2);
  EXPECT_DOUBLE_EQ(half.coarse, -1);
  // Over iterations: a bias of N^-(1 - alpha).
  const Extrapolation by = over_iterations(16, 1024, 0.75);
  EXPECT_NEAR(by.fine * (3 + std::pow(1024, -0.25)) + by.coarse * (3 + std::pow(16, -0.25)), 3, 1e-14);
  EXPECT_THROW(over_iterations(16, 1024, 1), std::invalid_argument) << "no bias falls";
  EXPECT_THROW(extrapolation(1, 1), std::invalid_argument) << "one size";
  EXPECT_THROW(extrapolate(std::vector<double>(2), std::vector<double>(3), half), std::invalid_argument);
}

// Claim: the standard error is right whatever the pairs have in common: of 2000 extrapolations of 12 noisy
// pairs, correlated by 0.8 or not at all, 95 % intervals hold the limit in 1900, within 4.5 binomial standard
// deviations (7e-6 each). Its size is that of the formula too.
TEST(Extrapolation, KnowsItsError) {
  constexpr int kTrials = 2000, kPairs = 12;
  for (const double correlation : {0.0, 0.8}) {
    rng::Stream stream(static_cast<std::uint64_t>(7 + 10 * correlation));
    int covered = 0;
    Moments variances;
    for (int trial = 0; trial < kTrials; ++trial) {
      std::vector<double> coarse, fine;
      for (int k = 0; k < kPairs; ++k) {
        const double common = normal(stream);
        const auto noise = [&] {
          return std::sqrt(correlation) * common + std::sqrt(1 - correlation) * normal(stream);
        };
        coarse.push_back(1 + 0.5 * 0.2 + 0.1 * noise());
        fine.push_back(1 + 0.5 * 0.1 + 0.1 * noise());
      }
      const Moments limit = extrapolate(coarse, fine, over_half_radius());
      covered +=
          student_two_sided(t_statistic(limit.mean() - 1, limit.error()), limit.freedom()) > 0.05 ? 1 : 0;
      variances.add(limit.variance_of_mean());
    }
    EXPECT_NEAR(covered, 0.95 * kTrials, 4.5 * std::sqrt(0.95 * 0.05 * kTrials)) << correlation;
    const double expected = 0.01 * (4 + 1 - 4 * correlation) / kPairs;
    EXPECT_NEAR(variances.mean() / expected, 1, 4.5 * std::sqrt(2.0 / (kPairs - 1) / kTrials)) << correlation;
  }
}

}  // namespace
}  // namespace candela::statistical
