// Chains in primary sample space, run by the code that renders: their stationary density, their
// reversibility, and how they are cut.
//
// The statistical tests start each of many independent chains at an exact sample of the target (by
// rejection), run it for a while, and look at where it ends: these ends are independent, so that textbook
// tests hold. Each p-value is compared with 1e-5; there are 9 of them: a false alarm for new seeds has a
// chance below 1e-4.
#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>
#include <vector>

#include "tests/unit/chi_squared.h"
#include "tests/unit/kolmogorov.h"
#include "tests/unit/mcmc_targets.h"

namespace candela::mcmc {
namespace {

constexpr double kAlpha = 1e-5;

struct Ends {
  transport::FilmPosition first, last;
};

// Of `count` chains of `mutations` mutations. most: a bound of the target.
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
    film::Tallies tallies;
    chains::ChainRecord record;
    ChainRules rules;
    rules.seed = seed;
    rules.b0 = 1;
    rules.prob_large = prob_large;
    rules.segment_mutations = mutations;
    const auto done = run_segment(space, rules, chain, {sample++, {}}, {nullptr, tallies}, record);
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
  return freedom == 0 ? 1 : test::upper_gamma(0.5 * freedom, 0.5 * statistic);
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

chains::ChainRecord run(PrimaryTarget& target, std::uint64_t mutations, std::uint64_t segments) {
  chains::ChainRecord record;
  film::Tallies tallies;
  ChainRules rules;
  rules.seed = 5;
  rules.b0 = 1;
  rules.segment_mutations = mutations;
  for (std::uint64_t i = 0; i < segments; ++i) {
    PrimarySpace space(target, kWide);  // another process, perhaps
    const chains::ChainStart start{1, record};
    EXPECT_TRUE(run_segment(space, rules, 77, start, {nullptr, tallies}, record).ok());
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
  film::Tallies tallies;
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
  const auto from_dark = run_segment(space, rules, 0, {dark, {}}, {nullptr, tallies}, record);
  ASSERT_FALSE(from_dark.ok());
  EXPECT_EQ(from_dark.error().kind, ErrorKind::input);
  chains::ChainRecord later;
  later.segments = 1;
  later.counts.mutations = 10;
  EXPECT_FALSE(run_segment(space, rules, 0, {0, later}, {nullptr, tallies}, record).ok()) << "no state";
  PrimaryState state({});
  state.start(bootstrap_key(5, 0));
  later.state = state.save();
  later.counts.mutations = 11;
  EXPECT_FALSE(run_segment(space, rules, 0, {0, later}, {nullptr, tallies}, record).ok()) << "other counts";
}

// Claim: proposals that are not finite, or negative, are never accepted, count by their cause, and are not in
// the sums that b is made of.
TEST(McmcChain, QuarantinesWhatIsNoNumber) {
  test::FunctionTarget target([](PrimaryState& numbers) {
    const float x = test::draw(numbers, 0);
    const double value = x < 0.25f ? 1 : x < 0.5f ? NAN : x < 0.75f ? INFINITY : -1;
    return std::pair(value, transport::FilmPosition{x, 0});
  });
  film::Tallies tallies;
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
  ASSERT_TRUE(run_segment(space, rules, 0, {sample, {}}, {nullptr, tallies}, record).ok());
  using film::RejectCause;
  for (const RejectCause cause : {RejectCause::not_a_number, RejectCause::infinite, RejectCause::negative})
    EXPECT_GT(tallies.rejected[static_cast<std::size_t>(cause)], 100u);
  EXPECT_NEAR(record.counts.large_sum / static_cast<double>(record.counts.large_steps), 0.25, 0.06);
  ASSERT_TRUE(space.restore(record.state, list).ok());
  EXPECT_EQ(list.scalar(), 1);
  EXPECT_LT(list.splats()[0].at.x, 0.25f);
}

}  // namespace
}  // namespace candela::mcmc
