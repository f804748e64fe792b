// Means of very small jobs of chains: the bound of docs/normalisation.md on their bias, by the
// code that renders, on a target whose image is known.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdio>

#include "tests/unit/mcmc_targets.h"
#include "worker/film/filter.h"

namespace candela::mcmc {
namespace {

constexpr std::uint32_t kPixels = 4;
constexpr std::uint64_t kChains = 8, kMutations = 3;
constexpr double kLargeStep = 0.3;

double contribution(double x) {
  return 0.25 + 3 * x * x;
}
// Integral over [from, to].
double integral(double from, double to) {
  return 0.25 * (to - from) + to * to * to - from * from * from;
}

// Moments of the contribution of one sample, relative to b.
struct Moments {
  double b = integral(0, 1), variance = 0, third = 0;
};
Moments moments() {
  Moments m;
  constexpr int kSteps = 100000;
  for (int i = 0; i < kSteps; ++i) {
    const double d = contribution((i + 0.5) / kSteps) / m.b - 1;
    m.variance += d * d / kSteps;
    m.third += d * d * d / kSteps;
  }
  return m;
}

// Bound in units of b, for whatever is at most a path's luminance.
double bound(const Moments& m, std::uint64_t samples) {
  const auto n = static_cast<double>(samples);
  return (1.25 + 3.6 * m.variance) / n + std::max(m.third, 0.0) / (n * n) +
         std::sqrt(m.variance) / (4 * std::sqrt(static_cast<double>(kChains) * n));
}

// Pixels' shares of the mean luminance, as one whole job finds them.
std::array<double, kPixels> render(std::uint64_t samples, std::uint64_t seed) {
  test::FunctionTarget target([](PrimaryState& numbers) {
    const float x = test::draw(numbers, 0);
    return std::pair(contribution(static_cast<double>(x)), transport::FilmPosition{x * kPixels, 0.5F});
  });
  PrimarySpace space(target, {1.0 / 1024, 1.0 / 64});
  SplatList list;
  film::SampleCounts sample_counts;
  std::vector<float> values(samples);
  for (std::uint64_t i = 0; i < samples; ++i) {
    space.start(bootstrap_key(seed, i), list);
    values[i] = static_cast<float>(usable_scalar(list, sample_counts));
  }
  chains::BootstrapTable table(samples);
  EXPECT_TRUE(table.insert(0, values).ok());
  ChainRules rules;
  rules.seed = seed;
  rules.b0 = table.normalisation().b;
  rules.prob_large = kLargeStep;
  rules.segment_mutations = kMutations;
  rules.pixels = kPixels;
  const auto filter = film::PixelFilter::create("box", {});
  film::UnitFilm film({kPixels, 1, 2}, chains::film_scale_log2(rules.b0, 0));
  const transport::Splatter splatter(*filter, film, kPixels, 1);
  const auto starts = table.choose_starts(kChains, seed);
  std::vector<chains::ChainCounts> counts;
  for (std::uint64_t chain = 0; chain < kChains; ++chain) {
    chains::ChainRecord record;
    EXPECT_TRUE(
        run_segment(space, rules, chain, {starts[chain], {}}, {&splatter, sample_counts}, record).ok());
    counts.push_back(record.counts);
  }
  const film::Development development = chains::development(rules.b0, chains::pool(table, counts));
  const double to_value = std::ldexp(1.0, -film.scale_log2()) / (kChains * double{kPixels});
  std::array<double, kPixels> shares{};
  for (std::size_t i = 0; i < kPixels; ++i)
    shares[i] = to_value * (development.factor * static_cast<double>(film.sums()[3 * i]) +
                            static_cast<double>(film.sums()[3 * (kPixels + i)]));
  return shares;
}

// Claim: the mean over many jobs of three mutations a chain, from as few as 4 bootstrap samples, is the image
// but for a bias within the stated bound, of each pixel and of their sum; and it falls as the number of
// samples grows. Comparisons at 5 standard errors: 20 of them, false-alarm rate 1.2e-5.
TEST(ChainBias, OfShortJobsIsWithinItsBound) {
  const Moments m = moments();
  for (const auto& [samples, jobs] :
       {std::pair<std::uint64_t, std::uint64_t>{4, 40000}, {16, 40000}, {64, 40000}, {256, 20000}}) {
    std::array<double, kPixels + 1> sum{}, squares{};
    for (std::uint64_t job = 0; job < jobs; ++job) {
      const auto shares = render(samples, rng::key(77, samples, job));
      double all = 0;
      for (std::size_t i = 0; i <= kPixels; ++i) {
        const double value = i < kPixels ? shares[i] : all;
        all += value;
        sum[i] += value;
        squares[i] += value * value;
      }
    }
    const auto n = static_cast<double>(jobs);
    const double most = bound(m, samples);
    std::printf("%3lu samples, bound %.4f:", samples, most);
    for (std::size_t i = 0; i <= kPixels; ++i) {
      const double mean = sum[i] / n, error = std::sqrt((squares[i] / n - mean * mean) / (n - 1)) / m.b;
      const double truth = i < kPixels ? integral(double(i) / kPixels, double(i + 1) / kPixels) : m.b;
      const double bias = (mean - truth) / m.b;
      std::printf("  %+.4f +- %.4f", bias, error);
      EXPECT_LT(std::abs(bias), most + 5 * error) << samples << " samples, pixel " << i;
    }
    std::printf("\n");
  }
}

}  // namespace
}  // namespace candela::mcmc
