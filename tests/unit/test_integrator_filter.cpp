// Claims: every pixel filter integrates to one; its samples follow the density it states (chi-squared), which
// is |f| where that is possible; the mean weight is 1 and weighted samples have the moments of f, so that a
// flat image stays flat and a linear one linear; splats by eval() give each position the same total; settings
// are checked by name.
// False-alarm rate: 12 chi-squared tests at 1e-6 and 36 means at 5 standard errors (6e-7): below 4e-5.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "common/rng/stream.h"
#include "tests/unit/chi_squared.h"
#include "worker/film/filter.h"

namespace candela::film {
namespace {

struct FilterCase {
  std::string name;
  SettingsMap settings;
  bool negative;
};
const std::vector<FilterCase> kCases = {
    {"box", {}, false},
    {"box", {{"radius", "1.25"}}, false},
    {"tent", {}, false},
    {"gaussian", {}, false},
    {"gaussian", {{"stddev", "1.5"}}, false},
    {"mitchell", {}, true},
    {"mitchell", {{"B", "1"}, {"C", "0"}}, false},  // a B-spline
    {"mitchell", {{"B", "0.25"}, {"C", "0.55"}}, true},
    {"catmullrom", {}, true},
    {"lanczos", {}, true},
    {"lanczos", {{"lobes", "1"}}, false},
    {"lanczos", {{"lobes", "5"}}, true},
};

PixelFilter make(const FilterCase& c) {
  auto filter = PixelFilter::create(c.name, c.settings);
  EXPECT_TRUE(filter.ok()) << c.name;
  return *filter;
}

template <class F>
double integrate(double a, double b, int n, const F& f) {
  double sum = 0;
  for (int i = 0; i < n; ++i) sum += f(a + (b - a) * (i + 0.5) / n);
  return sum * (b - a) / n;
}

TEST(PixelFilters, IntegrateToOne) {
  for (const FilterCase& c : kCases) {
    const PixelFilter filter = make(c);
    const double r = filter.radius();
    EXPECT_NEAR(integrate(-r, r, 20000, [&](double x) { return filter.eval_1d(x); }), 1, 1e-6) << c.name;
    EXPECT_NEAR(integrate(-r, r, 20000, [&](double x) { return filter.pdf_1d(x); }), 1, 1e-6) << c.name;
    EXPECT_EQ(filter.has_negative_lobes(), c.negative) << c.name;
    EXPECT_EQ(filter.eval_1d(r * 1.001), 0);
    EXPECT_EQ(filter.eval_1d(0.3 * r), filter.eval_1d(-0.3 * r));
  }
}

// Values of the definitions, by hand.
TEST(PixelFilters, AreMitsubas) {
  const PixelFilter mitchell = make({"mitchell", {}, true});
  EXPECT_NEAR(mitchell.eval_1d(0), 8.0 / 9, 1e-12);
  EXPECT_NEAR(mitchell.eval_1d(1), 1.0 / 18, 1e-12);
  EXPECT_NEAR(mitchell.eval_1d(1.5), (-7.0 / 3 * 3.375 + 12 * 2.25 - 20 * 1.5 + 32.0 / 3) / 6, 1e-12);
  const PixelFilter catmull = make({"catmullrom", {}, true});
  EXPECT_NEAR(catmull.eval_1d(0), 1, 1e-12);
  EXPECT_NEAR(catmull.eval_1d(0.5), 0.5625, 1e-12);
  EXPECT_NEAR(catmull.eval_1d(1.5), -0.0625, 1e-12);
  const PixelFilter lanczos = make({"lanczos", {}, true});
  const double pi = 3.14159265358979323846;
  EXPECT_NEAR(lanczos.eval_1d(1.5) / lanczos.eval_1d(0),
              std::sin(1.5 * pi) / (1.5 * pi) * std::sin(0.5 * pi) / (0.5 * pi), 1e-9);
  EXPECT_NEAR(lanczos.eval_1d(2), 0, 1e-9);
}

TEST(PixelFilters, SamplesFollowTheirDensity) {
  std::uint64_t seed = 0;
  for (const FilterCase& c : kCases) {
    const PixelFilter filter = make(c);
    const double r = filter.radius();
    constexpr int kBins = 20, kSamples = 200000;
    std::vector<double> edge_mass(kBins), observed(kBins * kBins), expected(kBins * kBins);
    for (int i = 0; i < kBins; ++i)
      edge_mass[static_cast<std::size_t>(i)] = integrate(-r + 2 * r * i / kBins, -r + 2 * r * (i + 1) / kBins,
                                                         400, [&](double x) { return filter.pdf_1d(x); });
    for (std::size_t i = 0; i < kBins; ++i)
      for (std::size_t j = 0; j < kBins; ++j)
        expected[i * kBins + j] = kSamples * edge_mass[i] * edge_mass[j];
    const double absolute = integrate(-r, r, 40000, [&](double x) { return std::fabs(filter.eval_1d(x)); });
    rng::Stream stream(rng::key(8, ++seed));
    double sum = 0, squares = 0, first = 0, first_squares = 0, largest = 0;
    int odd_ones = 0;
    for (int i = 0; i < kSamples; ++i) {
      const float u = stream.next_float();
      float weight = 0;
      const Vec2 p = filter.sample({u, stream.next_float()}, weight);
      const double x = static_cast<double>(p.x), y = static_cast<double>(p.y),
                   w = static_cast<double>(weight);
      ASSERT_LE(std::fabs(x), r);
      ASSERT_LE(std::fabs(y), r);
      // weight = value / pdf, away from the density's zeros, where an offset rounded to float decides.
      if (filter.pdf_1d(x) > 1e-3 && filter.pdf_1d(y) > 1e-3) {
        ASSERT_NEAR(w, filter.eval_1d(x) * filter.eval_1d(y) / (filter.pdf_1d(x) * filter.pdf_1d(y)), 1e-3);
      }
      largest = std::max(largest, std::fabs(w));
      if (std::fabs(std::fabs(w) - absolute * absolute) > 0.02) ++odd_ones;
      sum += w;
      squares += w * w;
      first += w * x;
      first_squares += w * x * w * x;
      const auto bin = [&](double v) {
        return std::min(static_cast<std::size_t>((v + r) / (2 * r) * kBins), std::size_t{kBins - 1});
      };
      observed[bin(x) * kBins + bin(y)] += 1;
    }
    EXPECT_GT(test::chi_squared_p(observed, expected), 1e-6) << c.name;
    const double n = kSamples, mean = sum / n,
                 error = std::sqrt(std::max(0.0, squares / n - mean * mean) / n);
    EXPECT_NEAR(mean, 1, 5 * error + 1e-5) << c.name;
    EXPECT_NEAR(first / n, 0, 5 * std::sqrt(first_squares / n / n)) << c.name;
    EXPECT_LT(largest, absolute * absolute * 1.05) << c.name;  // no spikes
    EXPECT_LT(odd_ones, kSamples / 50) << c.name;              // importance sampling of |f|
  }
}

// A position gives pixels in all: 1 where the filter's shifts sum to one; on average always.
TEST(PixelFilters, SplatsOfAPositionSumToOneOnAverage) {
  for (const FilterCase& c : kCases) {
    const PixelFilter filter = make(c);
    double mean = 0;
    constexpr int kSteps = 32;
    const int reach = static_cast<int>(std::ceil(filter.radius())) + 1;
    for (int sx = 0; sx < kSteps; ++sx) {
      for (int sy = 0; sy < kSteps; ++sy) {
        double total = 0;
        const float x = static_cast<float>(sx) / kSteps, y = static_cast<float>(sy) / kSteps;
        for (int px = -reach; px <= reach; ++px)
          for (int py = -reach; py <= reach; ++py)
            total += static_cast<double>(
                filter.eval(x - static_cast<float>(px) - 0.5f, y - static_cast<float>(py) - 0.5f));
        if (c.name == "box" && c.settings.empty()) {
          EXPECT_EQ(total, 1);
        }
        if (c.name == "mitchell" || c.name == "catmullrom" || c.name == "tent") {
          EXPECT_NEAR(total, 1, 1e-5) << c.name;
        }
        mean += total / (kSteps * kSteps);
      }
    }
    EXPECT_NEAR(mean, 1, 2e-3) << c.name;
  }
}

TEST(PixelFilters, RefuseWhatTheyDoNotHave) {
  EXPECT_FALSE(PixelFilter::create("sinc", {}).ok());
  EXPECT_FALSE(PixelFilter::create("lanczos", {{"lobes", "2.5"}}).ok());
  EXPECT_FALSE(PixelFilter::create("lanczos", {{"lobes", "0"}}).ok());
  EXPECT_FALSE(PixelFilter::create("lanczos", {{"lobes", "33"}}).ok());
  EXPECT_FALSE(PixelFilter::create("mitchell", {{"A", "1"}}).ok());
  EXPECT_FALSE(PixelFilter::create("mitchell", {{"B", "nan"}}).ok());
  EXPECT_FALSE(PixelFilter::create("catmullrom", {{"radius", "1"}}).ok());
  EXPECT_FALSE(PixelFilter::create("box", {{"radius", "x"}}).ok());
}

}  // namespace
}  // namespace candela::film
