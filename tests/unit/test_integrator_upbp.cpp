// The choice of upbp among sets of techniques, and the hits that its weights count: pure arithmetic on
// planted trials and counts.
#include <gtest/gtest.h>

#include <cmath>

#include "common/rng/stream.h"
#include "worker/integrators/pilot/trials.h"
#include "worker/integrators/upbp/hits.h"
#include "worker/integrators/upbp/work_counts.h"
#include "worker/transport/radius.h"

namespace candela::integrators::upbp {
namespace {

using pilot::Choice;
using pilot::choose;
using pilot::kReplicates;
using pilot::last_is_better;
using pilot::means_of_squares;
using pilot::Trial;
using pilot::trial_errors;

constexpr std::size_t kValues = 3072;

// Images of a known truth, each value with noise of this variance relative to its square; `lit`: the share of
// the light that the trial finds.
Trial planted(double variance, double lit, double cost, std::uint64_t seed) {
  Trial trial;
  trial.cost = cost;
  for (std::size_t r = 0; r < kReplicates; ++r) {
    rng::Stream stream(rng::key(seed, r));
    for (std::size_t i = 0; i < kValues; ++i) {
      const double truth = 1 + 0.5 * std::sin(0.1 * static_cast<double>(i));
      const double noise = std::sqrt(12 * variance) * (stream.next_double() - 0.5);
      trial.images[r].push_back(static_cast<float>(truth * lit * (1 + noise)));
    }
  }
  return trial;
}

// Claim: the error is the variance, however noisy the trials are that the truth is made of.
TEST(UpbpChoice, ErrorIsTheVariance) {
  const std::vector<Trial> trials = {planted(0.04, 1, 1, 1), planted(0.01, 1, 1, 2), planted(0.2, 1, 1, 3)};
  const std::vector<double> errors = trial_errors(trials);
  EXPECT_NEAR(errors[0], 0.04, 0.006);
  EXPECT_NEAR(errors[1], 0.01, 0.004);
  EXPECT_NEAR(errors[2], 0.2, 0.03);
}

// Claim: what is chosen has the least product of error and cost, and the others' products are relative to it.
TEST(UpbpChoice, LeastErrorTimesCostIsChosen) {
  const std::vector<Trial> trials = {planted(0.12, 1, 1, 1), planted(0.04, 1, 2, 2), planted(0.02, 1, 9, 3)};
  const Choice choice = choose(trials);
  EXPECT_EQ(choice.index, 1U);
  EXPECT_EQ(choice.inefficiency[1], 1);
  EXPECT_NEAR(choice.inefficiency[0], 1.5, 0.3);
  EXPECT_NEAR(choice.inefficiency[2], 2.25, 0.6);
  EXPECT_EQ(choice.cost, (std::vector<double>{1, 2, 9}));
}

// Claim: a film with eight times as many light paths pays eight times as much for merges with points and the
// nodes that those points fill, twice as much for other nodes of points, which are half as wide, an eighth
// a pixel for building trees of beams, and the same for all else.
TEST(UpbpChoice, CostIsThatOfTheJobsFilm) {
  const auto cost_of = [](std::uint64_t WorkCounts::*count, double density) {
    WorkCounts counts;
    counts.*count = 100;
    return counts.cost(density);
  };
  using Case = std::pair<std::uint64_t WorkCounts::*, double>;
  for (const auto& [count, ratio] :
       {Case{&WorkCounts::rays, 1}, Case{&WorkCounts::queries, 1}, Case{&WorkCounts::points, 1},
        Case{&WorkCounts::searched, 1}, Case{&WorkCounts::beam_nodes, 1}, Case{&WorkCounts::beam_merges, 1},
        Case{&WorkCounts::point_nodes, 2}, Case{&WorkCounts::pieces, 0.125}}) {
    EXPECT_GT(cost_of(count, 1), 0);
    EXPECT_NEAR(cost_of(count, 8), ratio * cost_of(count, 1), 1e-9 * cost_of(count, 8));
  }
  const double merge = cost_of(&WorkCounts::point_merges, 1), node = cost_of(&WorkCounts::point_nodes, 1);
  EXPECT_NEAR(cost_of(&WorkCounts::point_merges, 8), 8 * merge + (8 - 2) * node / 8, 1e-9 * merge);
}

// Claim: of trials whose products differ by less than 5 % the last that is cheap is chosen, which has the
// most techniques; one that costs more than 1.5 times the first only if its product is the least.
TEST(UpbpChoice, OfCheapTrialsThatAreAlikeTheLastIsChosen) {
  const auto at_cost = [](Trial trial, double cost) {
    trial.cost = cost;
    return trial;
  };
  const Trial noisy = planted(0.08, 1, 1, 1), better = planted(0.02, 1, 1, 2);
  const auto cheap = [&](double cost) {
    return choose(std::vector<Trial>{better, at_cost(better, cost)}).index;
  };
  EXPECT_EQ(cheap(1.04), 1U);
  EXPECT_EQ(cheap(1.06), 0U);
  const auto dear = [&](double cost) {
    return choose(std::vector<Trial>{noisy, at_cost(better, 2), at_cost(better, cost)}).index;
  };
  EXPECT_EQ(dear(2.04), 1U);
  EXPECT_EQ(dear(1.96), 2U);
}

// Claim: means are those of whole squares and of what is left of them at the rim, in rows; small images have
// smaller squares.
TEST(UpbpChoice, MeansAreThoseOfSquares) {
  const auto image = [](std::uint32_t width, std::uint32_t height) {
    std::vector<float> values;
    for (std::uint32_t y = 0; y < height; ++y)
      for (std::uint32_t x = 0; x < width; ++x)
        for (std::uint32_t c = 0; c < 3; ++c) values.push_back(static_cast<float>(100 * y + x + 1000 * c));
    return values;
  };
  const std::vector<float> large = means_of_squares(image(34, 32), 34, 32);
  ASSERT_EQ(large.size(), 3U * 5 * 4);
  EXPECT_FLOAT_EQ(large[0], 350 + 3.5f);
  EXPECT_FLOAT_EQ(large[1], 1000 + 350 + 3.5f);
  EXPECT_FLOAT_EQ(large[3 * 4 + 2], 2000 + 350 + 32.5f);
  EXPECT_FLOAT_EQ(large[3 * 5], 1150 + 3.5f);
  EXPECT_EQ(means_of_squares(image(3, 2), 3, 2), image(3, 2));
  EXPECT_EQ(means_of_squares(image(9, 8), 9, 8).size(), 3U * 5 * 4);
}

// Claim: a trial that misses half of the light is not chosen for its lack of noise.
TEST(UpbpChoice, MissingLightIsAnError) {
  const std::vector<Trial> trials = {planted(1e-4, 0.5, 1, 1), planted(0.04, 1, 2, 2),
                                     planted(0.05, 1, 6, 3)};
  EXPECT_EQ(choose(trials).index, 1U);
}

// Claim: a set with fewer connections is taken if its error grows by less than its cost falls.
TEST(UpbpChoice, FewerConnectionsAreTakenWhereTheyPay) {
  const auto better = [](double noise, double cost) {
    const std::vector<Trial> trials = {planted(0.04, 1, 1, 1), planted(0.02, 1, 2, 2),
                                       planted(noise, 1, cost, 3)};
    return last_is_better(trials, 1);
  };
  EXPECT_TRUE(better(0.02, 1.4));
  EXPECT_FALSE(better(0.02, 2.8));
  EXPECT_FALSE(better(0.04, 1.4));
}

// Claim: hits that fall with the volume of the kernel from iteration to iteration are expected as in the
// first, by each kind's own dimension; more light paths mean more of those with points, more beams of those
// with beams; and each number of samples is divided by one more than its hits in that iteration.
TEST(UpbpHits, AreThoseOfTheFirstIteration) {
  const auto volume = [](std::uint64_t iteration, int dimension) {
    return std::pow(transport::blur_radius(1, iteration, dimension), dimension);
  };
  constexpr double kQueries = 1e9;
  const auto of = [](double queries, double hits) { return static_cast<std::uint64_t>(queries * hits); };
  HitCounts counts;
  for (const std::uint64_t iteration : {0U, 2U, 9U}) {
    const double queries = kQueries * static_cast<double>(iteration + 1);
    transport::MergeWork work;
    work.queries = {of(queries, 1), of(queries, 2), of(queries, 3), of(queries, 4)};
    work.merges = {of(queries, 0.5 * volume(iteration, 3)), of(queries, 2 * 0.25 * volume(iteration, 2)),
                   of(queries, 3 * 2 * volume(iteration, 2)), of(queries, 4 * 3 * volume(iteration, 1))};
    counts.add(work, iteration);
  }
  const ExpectedHits first = counts.expected(), job = first.scaled(10, 2);
  EXPECT_NEAR(first.point_point, 0.5, 1e-8);
  EXPECT_NEAR(first.point_beam, 0.25, 1e-8);
  EXPECT_NEAR(first.beam_point, 2, 1e-8);
  EXPECT_NEAR(first.beam_beam, 3, 1e-8);
  transport::MediumMerges eta{1, 2, 3, 4};
  job.in(7).divide(eta);
  EXPECT_NEAR(eta.point_point, 1 / (1 + 5 * volume(7, 3)), 1e-7);
  EXPECT_NEAR(eta.point_beam, 2 / (1 + 2.5 * volume(7, 2)), 1e-7);
  EXPECT_NEAR(eta.beam_point, 3 / (1 + 4 * volume(7, 2)), 1e-7);
  EXPECT_NEAR(eta.beam_beam, 4 / (1 + 6 * volume(7, 1)), 1e-7);
  EXPECT_EQ(HitCounts().expected().beam_beam, 0);
}

// Claim: of black trials the cheapest is chosen.
TEST(UpbpChoice, OfBlackTrialsTheCheapestIsChosen) {
  EXPECT_EQ(choose(std::vector<Trial>{planted(0, 0, 2, 1), planted(0, 0, 4, 2)}).index, 0U);
}

}  // namespace
}  // namespace candela::integrators::upbp
