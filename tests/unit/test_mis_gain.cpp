// Tests of the measured gain of optimal weights (common/mis/gain.h).
#include <gtest/gtest.h>

#include <string_view>

#include "common/mis/gain.h"
#include "tests/mis_problems.h"
#include "tests/unit/mis_table.h"

namespace candela {
namespace {

using test::MisProblem;

double variance_of(std::string_view problem, std::string_view strategy) {
  for (const test::MisRow& row : test::kMisTable)
    if (row.problem == problem && row.strategy == strategy) return row.variance;
  ADD_FAILURE() << problem << " " << strategy;
  return 0;
}

mis::Variances measured(const MisProblem& p, int batches, int pixels) {
  mis::Variances sum;
  mis::PixelBatches pixel(p.allocation);
  rng::Stream random(rng::key(1));
  for (int i = 0; i < pixels; ++i) {
    pixel.clear();
    for (int b = 0; b < batches; ++b)
      pixel.add(static_cast<std::size_t>(b % 2), test::mis_batches(p, 1, random));
    sum.add(pixel.variances(40));
  }
  return sum;
}

// Claim: both variances are the exact table's, whose ratios are from 0 to 1. The tolerance is five standard
// errors of a variance of 8192 batches with a kurtosis of 10.
TEST(MisGain, IsTheExactTables) {
  for (const char* name : {"D1", "D2", "D3", "D4", "D5", "D7"}) {
    const MisProblem p = test::mis_problem(name);
    const mis::Variances v = measured(p, 512, 16);
    const double balance = variance_of(name, "balance"), optimal = variance_of(name, "optimal");
    EXPECT_NEAR(v.balance / (16 * balance), 1, 0.17) << name;
    EXPECT_NEAR(v.ratio(), optimal / balance, 0.17 * optimal / balance + 1e-3) << name;
  }
}

// Claim: few batches tell less of a gain, since slopes from few are noisy; where there is none to have, more
// than 1.
TEST(MisGain, CountsTheNoiseOfSlopes) {
  EXPECT_GT(measured(test::mis_problem("D1"), 6, 512).ratio(),
            1.2 * measured(test::mis_problem("D1"), 64, 512).ratio());
  EXPECT_GT(measured(test::mis_problem("D7"), 8, 512).ratio(), 1.02);
}

// Claim: a pixel that has no second batch in a half says nothing, and one that never varies has the ratio 1.
TEST(MisGain, OfNothing) {
  const mis::Allocation two = mis::Allocation::ones(2);
  mis::PixelBatches pixel(two);
  EXPECT_EQ(pixel.variances(40).ratio(), 1);
  mis::Sums batch;
  batch.add(2, {0.5, 0.5}, {1, 1, 1});
  batch.add(2, {0.5, 0.5}, {1, 1, 1});
  pixel.add(0, batch);
  pixel.add(0, batch);
  pixel.add(1, batch);
  EXPECT_EQ(pixel.variances(40).balance, 0);
  pixel.add(1, batch);
  EXPECT_EQ(pixel.variances(40).balance, 0);
  EXPECT_EQ(pixel.variances(40).ratio(), 1);
}

}  // namespace
}  // namespace candela
