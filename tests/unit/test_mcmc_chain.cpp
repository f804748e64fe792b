// Chains in primary sample space, run by the code that renders: their stationary density, their
// reversibility, and how they are cut.
//
// The statistical tests start each of many independent chains at an exact sample of the target (by
// rejection), run it for a while, and look at where it ends: these ends are independent, so that textbook
// tests hold. Each p-value is compared with 1e-5; there are 11 of them: a false alarm for new seeds has a
// chance below 1.1e-4.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <vector>

#include "tests/statistical/batch_means.h"
#include "tests/statistical/moments.h"
#include "tests/unit/chi_squared.h"
#include "tests/unit/kolmogorov.h"
#include "tests/unit/mcmc_targets.h"
#include "worker/film/filter.h"
#include "worker/transport/splat.h"

namespace candela::mcmc {
namespace {

constexpr double kAlpha = 1e-5;

struct Ends {
  transport::FilmPosition first, last;
};

// For `count` chains of `mutations` mutations. most: a bound of the target.
std::vector<Ends> run_chains(PrimaryTarget& target, double most, std::uint64_t count, std::uint64_t mutations,
                             double prob_large, StepSizes sizes, std::uint64_t seed) {
  std::vector<Ends> ends;
  std::uint64_t sample = 0;
  rng::Stream choose(rng::key(seed, 1));
  SplatList list;
  for (std::uint64_t chain = 0; chain < count; ++chain) {
    PrimarySpace space(target, sizes);
    for (;; ++sample) {
      space.start(bootstrap_key(seed, sample), list);
      EXPECT_LE(list.scalar(), most);
      if (choose.next_double() * most < list.scalar()) break;
    }
    Ends one{list.splats()[0].at, {}};
    film::SampleCounts sample_counts;
    chains::ChainRecord record;
    ChainRules rules;
    rules.seed = seed;
    rules.b0 = 1;
    rules.prob_large = prob_large;
    rules.segment_mutations = mutations;
    const auto done = run_segment(space, rules, chain, {sample++, {}}, {nullptr, sample_counts}, record);
    EXPECT_TRUE(done.ok());
    EXPECT_TRUE(space.restore(record.state, list).ok());
    one.last = list.splats()[0].at;
    ends.push_back(one);
  }
  return ends;
}

// p of the hypothesis that places of the last states, put into cells, have these weights.
template <class Cell>
double stationary_p(const std::vector<Ends>& ends, const std::vector<double>& weights, const Cell& cell) {
  double total = 0;
  for (const double w : weights) total += w;
  std::vector<double> observed(weights.size(), 0.0), expected(weights.size());
  for (std::size_t i = 0; i < weights.size(); ++i)
    expected[i] = weights[i] / total * static_cast<double>(ends.size());
  for (const Ends& one : ends) ++observed[cell(one.last)];
  return test::chi_squared_p(observed, expected);
}

// p of the hypothesis that going from cell i to cell j is as frequent as from j to i [Bowker's test].
template <class Cell>
double reversible_p(const std::vector<Ends>& ends, std::size_t cells, const Cell& cell, std::size_t* moved) {
  std::vector<double> counts(cells * cells, 0.0);
  for (const Ends& one : ends) ++counts[cell(one.first) * cells + cell(one.last)];
  double statistic = 0;
  int freedom = 0;
  *moved = 0;
  for (std::size_t i = 0; i < cells; ++i) {
    for (std::size_t j = i + 1; j < cells; ++j) {
      const double there = counts[i * cells + j], back = counts[j * cells + i];
      *moved += static_cast<std::size_t>(there + back);
      if (there + back < 10) continue;
      statistic += (there - back) * (there - back) / (there + back);
      ++freedom;
    }
  }
  return statistical::chi_squared_tail(statistic, freedom);
}

// The share of ends that are not where they began.
double moved_share(const std::vector<Ends>& ends) {
  const auto moved = std::count_if(ends.begin(), ends.end(), [](const Ends& one) {
    return one.first.x != one.last.x || one.first.y != one.last.y;
  });
  return static_cast<double>(moved) / static_cast<double>(ends.size());
}

constexpr StepSizes kWide{1.0 / 64, 1.0 / 8};  // for chains of few mutations to get somewhere

// Claim: chains that start at samples of a steep 1-D target end at samples of it, by small steps alone and by
// both kinds (Kolmogorov-Smirnov), and go from any cell to any other as often as back.
TEST(McmcChain, KeepsAOneDimensionalTarget) {
  auto target = test::one_dimension();
  constexpr int kFine = 1 << 16;
  std::vector<double> cdf(kFine + 1, 0.0);
  for (int i = 0; i < kFine; ++i) cdf[i + 1] = cdf[i] + test::steep((i + 0.5) / kFine);
  for (const double prob_large : {0.0, 0.3}) {
    const auto ends = run_chains(target, 8, 160000, 24, prob_large, kWide, prob_large > 0 ? 11 : 12);
    EXPECT_GT(moved_share(ends), 0.9);
    std::vector<double> places;
    for (const Ends& one : ends) places.push_back(static_cast<double>(one.last.x));
    std::sort(places.begin(), places.end());
    double largest = 0;
    const auto n = static_cast<double>(places.size());
    for (std::size_t i = 0; i < places.size(); ++i) {
      const double at = places[i] * kFine;
      const int below = std::min(static_cast<int>(at), kFine - 1);
      const double f = (cdf[below] + (at - below) * (cdf[below + 1] - cdf[below])) / cdf[kFine];
      largest = std::max(
          {largest, std::abs(f - static_cast<double>(i) / n), std::abs(f - static_cast<double>(i + 1) / n)});
    }
    EXPECT_GT(test::kolmogorov_p(largest, n), kAlpha)
        << "distance " << largest << ", large steps " << prob_large;
    std::size_t moved = 0;
    const auto cell = [](transport::FilmPosition at) { return static_cast<std::size_t>(at.x * 16); };
    EXPECT_GT(reversible_p(ends, 16, cell, &moved), kAlpha) << prob_large;
    EXPECT_GT(moved, 2000u);
  }
}

// Claim: the same of a ridge in two dimensions (chi-squared over 12 x 12 cells).
TEST(McmcChain, KeepsATwoDimensionalTarget) {
  auto target = test::two_dimensions();
  constexpr std::size_t kCells = 12, kFine = 40;
  std::vector<double> weights(kCells * kCells, 0.0);
  for (std::size_t y = 0; y < kCells * kFine; ++y)
    for (std::size_t x = 0; x < kCells * kFine; ++x)
      weights[y / kFine * kCells + x / kFine] +=
          test::ridge((static_cast<double>(x) + 0.5) / (kCells * kFine),
                      (static_cast<double>(y) + 0.5) / (kCells * kFine));
  const auto ends = run_chains(target, 1.23, 160000, 24, 0.1, kWide, 13);
  EXPECT_GT(moved_share(ends), 0.9);
  const auto cell = [](transport::FilmPosition at) {
    return static_cast<std::size_t>(at.y * kCells) * kCells + static_cast<std::size_t>(at.x * kCells);
  };
  EXPECT_GT(stationary_p(ends, weights, cell), kAlpha);
  std::size_t moved = 0;
  EXPECT_GT(reversible_p(ends, kCells * kCells, cell, &moved), kAlpha);
  EXPECT_GT(moved, 2000u);
}

// Claim: where the numbers that are asked for change from state to state, those left behind and asked for
// again keep the chain at its target: (length, first number) of such a state have their known density, 0.2 +
// x, since the rest has mean 1; and going there and back is as frequent.
TEST(McmcChain, KeepsATargetOfChangingDimension) {
  auto target = test::growing();
  constexpr std::size_t kCells = 32;  // 8 to each length
  std::vector<double> weights;
  for (std::size_t i = 0; i < kCells; ++i)
    weights.push_back(0.2 + (static_cast<double>(i) + 0.5) / static_cast<double>(kCells));
  const auto cell = [](transport::FilmPosition at) { return static_cast<std::size_t>(at.x * kCells); };
  for (const double prob_large : {0.0, 0.1}) {
    // Many mutations: what was left behind has to be old when it is asked for.
    const auto ends = run_chains(target, 27, 80000, 60, prob_large, kWide, prob_large > 0 ? 14 : 15);
    EXPECT_GT(moved_share(ends), 0.9);
    EXPECT_GT(stationary_p(ends, weights, cell), kAlpha) << prob_large;
    std::size_t moved = 0;
    EXPECT_GT(reversible_p(ends, kCells, cell, &moved), kAlpha) << prob_large;
    EXPECT_GT(moved, 2000u);
  }
}

// Sum that segment after segment of a chain adds to a film of two pixels, as developed with the true b.
std::vector<std::array<double, 2>> segments(PrimaryTarget& target, double b, ChainRules rules,
                                            std::uint64_t chain, std::uint64_t count) {
  const auto filter = film::PixelFilter::create("box", {});
  constexpr int kScale = 30;
  film::UnitFilm film({2, 1, 2}, kScale);
  const transport::Splatter splatter(*filter, film, 2, 1);
  film::SampleCounts sample_counts;
  rules.pixels = 2;
  PrimarySpace space(target, kWide);
  chains::ChainRecord record;
  std::vector<std::array<double, 2>> found;
  for (std::uint64_t i = 0; i < count; ++i) {
    film.clear();
    const chains::ChainStart start{chain, record};
    EXPECT_TRUE(run_segment(space, rules, chain, start, {&splatter, sample_counts}, record).ok());
    const auto value = [&](std::size_t x) {
      const auto layer = [&](std::size_t l) {
        return std::ldexp(static_cast<double>(film.sums()[(2 * l + x) * film::kChannels]), -kScale);
      };
      return b / rules.b0 * layer(kChainsLayer) + layer(kIndependentLayer);
    };
    found.push_back({value(0), value(1)});
  }
  return found;
}

ChainRules rules_of(std::uint64_t seed, double b0, double prob_large, std::uint64_t mutations) {
  ChainRules rules;
  rules.seed = seed;
  rules.b0 = b0;
  rules.prob_large = prob_large;
  rules.segment_mutations = mutations;
  return rules;
}

// Claim: the picture is the target, whatever b0 and the share of large steps: the weights of the chain's
// states and of the independent samples sum to one. A target that is the same everywhere has no noise but
// that of how many steps are large, of a standard deviation of sqrt(p (1 - p) / mutations), here for 6 of 9
// cases compared with six of them: a false alarm in 2e-8 of seeds. Where all are large there is none at all.
TEST(McmcChain, WeightsOfTheFilmSumToOne) {
  test::FunctionTarget flat([](PrimaryState& numbers) {
    test::draw(numbers, 0);
    return std::pair(0.7, transport::FilmPosition{0.5f, 0.5f});
  });
  constexpr double kMutations = 1 << 18;
  for (const double b0 : {0.25, 0.7, 2.1})
    for (const double prob_large : {0.1, 0.5, 1.0}) {
      const ChainRules rules = rules_of(20, b0, prob_large, static_cast<std::uint64_t>(kMutations));
      const auto found = segments(flat, 0.7, rules, 0, 1)[0];
      const double noise =
          std::sqrt((1 - prob_large) / prob_large / kMutations);  // of the number of large steps
      const double part = prob_large / (0.7 / b0 + prob_large);
      EXPECT_NEAR(found[0] / 1.4, 1, 6 * noise * part + 1e-6) << b0 << " " << prob_large;
      EXPECT_EQ(found[1], 0);
    }
}

// A quarter of the numbers is worth 1, in the first pixel, the rest 4, in the second.
test::FunctionTarget two_steps() {
  return test::FunctionTarget([](PrimaryState& numbers) {
    const float x = test::draw(numbers, 0);
    return x < 0.25f ? std::pair(1.0, transport::FilmPosition{0.5f, 0.5f})
                     : std::pair(4.0, transport::FilmPosition{1.5f, 0.5f});
  });
}

// Claim: so it is where states are rejected: a quarter of the numbers is worth 1, in the first pixel, the
// rest 4, in the second. 12 comparisons at 6 standard errors of 64 chains (1e-7 each). The starts are
// uniform, not samples of the target, which adds less than 1e-3.
TEST(McmcChain, TheFilmIsTheTarget) {
  auto target = two_steps();
  for (const double b0 : {1.0, 3.25, 8.0})
    for (const double prob_large : {0.3, 0.9}) {
      std::array<statistical::Moments, 2> found;
      for (std::uint64_t chain = 0; chain < 64; ++chain) {
        const auto one = segments(target, 3.25, rules_of(21, b0, prob_large, 10000), chain, 1)[0];
        for (std::size_t x = 0; x < 2; ++x) found[x].add(one[x]);
      }
      for (std::size_t x = 0; x < 2; ++x) {
        const double expected = x == 0 ? 2 * 0.25 : 2 * 3.0;
        EXPECT_NEAR(found[x].mean(), expected, 6 * found[x].error() + 1e-3 * expected)
            << x << " " << b0 << " " << prob_large;
        EXPECT_LT(found[x].error(), 0.008 * expected) << x << " " << b0 << " " << prob_large;
      }
    }
}

// Claim: what a chain's own segments say of the error of its mean, by batch means, is what independent chains
// show: F of the variance over 64 chains to the mean of their estimates (8 batches each, 448 degrees of
// freedom), two-sided, alarms falsely with probability 1e-5. Segments are correlated: taken for independent
// ones they would say far too little, and F with them is refused.
TEST(McmcChain, BatchMeansTellTheErrorOfAChain) {
  auto target = two_steps();
  constexpr std::uint64_t kChains = 64;
  statistical::Moments means, by_batches, by_segments, effective;
  for (std::uint64_t chain = 0; chain < kChains; ++chain) {
    std::vector<double> series;
    for (const auto& one : segments(target, 3.25, rules_of(22, 3.25, 0.02, 2), chain, 4096))
      series.push_back(one[0]);
    const statistical::BatchMeans batches = statistical::batch_means(series, 8);
    means.add(batches.batches.mean());
    by_batches.add(batches.batches.variance_of_mean());
    by_segments.add(batches.members.variance_of_mean());
    effective.add(batches.effective());
  }
  std::printf(
      "error of a chain %.2e, by batch means %.2e, by segments %.2e; %.0f of 4096 segments effective\n",
      std::sqrt(means.variance()), std::sqrt(by_batches.mean()), std::sqrt(by_segments.mean()),
      effective.mean());
  const auto p = [&](const statistical::Moments& estimates, double freedom) {
    return statistical::fisher_two_sided(statistical::variance_ratio(means.variance(), estimates.mean()),
                                         means.freedom(), freedom);
  };
  EXPECT_GT(p(by_batches, kChains * 7), kAlpha);
  EXPECT_LT(p(by_segments, kChains * 4095.0), kAlpha);
  EXPECT_LT(effective.mean(), 2048);
}

chains::ChainRecord run(PrimaryTarget& target, std::uint64_t mutations, std::uint64_t segments) {
  chains::ChainRecord record;
  film::SampleCounts sample_counts;
  ChainRules rules;
  rules.seed = 5;
  rules.b0 = 1;
  rules.segment_mutations = mutations;
  for (std::uint64_t i = 0; i < segments; ++i) {
    PrimarySpace space(target, kWide);  // another process, perhaps
    const chains::ChainStart start{1, record};
    EXPECT_TRUE(run_segment(space, rules, 77, start, {nullptr, sample_counts}, record).ok());
    const auto copy = chains::decode(chains::encode(record));
    if (!copy.ok()) throw std::runtime_error("a record cannot be read");
    EXPECT_EQ(*copy, record);
  }
  return record;
}

// Claim: a chain is the same to the last bit wherever it is cut into segments, and whoever carries it on.
TEST(McmcChain, CutsChangeNothing) {
  auto target = test::growing();
  const chains::ChainRecord whole = run(target, 1200, 1);
  for (const std::uint64_t parts : {2, 24, 150, 1200}) {
    const chains::ChainRecord cut = run(target, 1200 / parts, parts);
    EXPECT_EQ(cut.counts, whole.counts) << parts;
    EXPECT_EQ(cut.state, whole.state) << parts;
  }
  EXPECT_GT(whole.counts.accepted, 200u);
  EXPECT_GT(whole.counts.large_accepted, 20u);
  EXPECT_GT(whole.counts.longest_stay, 1u);
}

// Claim: a start that has no contribution, or counts that are not the job's, are input errors and no crash.
TEST(McmcChain, RefusesStartsOfOtherJobs) {
  auto target = test::one_dimension();
  film::SampleCounts sample_counts;
  ChainRules rules;
  rules.seed = 5;
  rules.b0 = 1;
  rules.segment_mutations = 10;
  PrimarySpace space(target, {});
  SplatList list;
  std::uint64_t dark = 0;
  for (;; ++dark) {
    space.start(bootstrap_key(5, dark), list);
    if (list.splats().empty()) break;
  }
  chains::ChainRecord record;
  const auto from_dark = run_segment(space, rules, 0, {dark, {}}, {nullptr, sample_counts}, record);
  ASSERT_FALSE(from_dark.ok());
  EXPECT_EQ(from_dark.error().kind, ErrorKind::input);
  chains::ChainRecord later;
  later.segments = 1;
  later.counts.mutations = 10;
  EXPECT_FALSE(run_segment(space, rules, 0, {0, later}, {nullptr, sample_counts}, record).ok()) << "no state";
  PrimaryState state({});
  state.start(bootstrap_key(5, 0));
  later.state = state.save();
  later.counts.mutations = 11;
  EXPECT_FALSE(run_segment(space, rules, 0, {0, later}, {nullptr, sample_counts}, record).ok())
      << "other counts";
}

// Claim: proposals that are not finite, or negative, are never accepted, count by their cause, and are not in
// the sums that b is made of.
TEST(McmcChain, QuarantinesWhatIsNoNumber) {
  test::FunctionTarget target([](PrimaryState& numbers) {
    const float x = test::draw(numbers, 0);
    const double value = x < 0.25f ? 1 : x < 0.5f ? NAN : x < 0.75f ? INFINITY : -1;
    return std::pair(value, transport::FilmPosition{x, 0});
  });
  film::SampleCounts sample_counts;
  ChainRules rules;
  rules.seed = 6;
  rules.b0 = 0.25;
  rules.segment_mutations = 4000;
  PrimarySpace space(target, {});
  SplatList list;
  std::uint64_t sample = 0;
  for (;; ++sample) {
    space.start(bootstrap_key(6, sample), list);
    if (list.scalar() == 1) break;
  }
  chains::ChainRecord record;
  ASSERT_TRUE(run_segment(space, rules, 0, {sample, {}}, {nullptr, sample_counts}, record).ok());
  using film::RejectCause;
  for (const RejectCause cause : {RejectCause::not_a_number, RejectCause::infinite, RejectCause::negative})
    EXPECT_GT(sample_counts.rejected[static_cast<std::size_t>(cause)], 100u);
  EXPECT_NEAR(record.counts.large_sum / static_cast<double>(record.counts.large_steps), 0.25, 0.06);
  ASSERT_TRUE(space.restore(record.state, list).ok());
  EXPECT_EQ(list.scalar(), 1);
  EXPECT_LT(list.splats()[0].at.x, 0.25f);
}

}  // namespace
}  // namespace candela::mcmc
