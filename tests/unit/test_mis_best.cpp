// Weights of the best technique. Seeds are fixed; comparisons of means are at five standard errors.
#include <gtest/gtest.h>

#include <cmath>

#include "common/film/accumulator.h"
#include "common/mis/best.h"
#include "common/stages/development.h"
#include "common/stages/developments/best_technique.h"
#include "tests/mis_problems.h"
#include "tests/unit/mis_table.h"

namespace candela {
namespace {

using mis::Singles;
using test::MisProblem;

// One batch in color 0: the estimate of each technique by its own samples, and the balance heuristic's.
Singles best_batch(const MisProblem& p, rng::Stream& random) {
  Singles out;
  out.batches = 1;
  for (std::size_t i = 0; i < p.size(); ++i) {
    const int count = static_cast<int>(p.allocation.counts[i]);
    for (int n = 0; n < count; ++n) {
      const double x = p.techniques[i].sample(random.next_double());
      if (p.techniques[i].fail > 0 && random.next_double() < p.techniques[i].fail) continue;
      out.single[i][0] += p.f(x) / p.pdf(i, x) / count;
      out.balance[0] += mis::controls(p.allocation, p.densities(x)).over_q(p.f(x));
    }
    out.squares[i] = out.single[i][0] * out.single[i][0];
  }
  return out;
}

mis::Eligible all_but(const MisProblem& p, int left_out) {
  mis::Eligible eligible = (1U << p.size()) - 1;
  if (left_out >= 0) eligible &= ~(1U << left_out);
  return eligible;
}

double table_best(std::string_view problem) {
  for (const test::MisRow& row : test::kMisTable)
    if (row.problem == problem && row.strategy == std::string_view("best")) return row.variance;
  throw std::runtime_error("no row of " + std::string(problem));
}

// Claim: the technique is that of the exact table, and the image from the other half's choice is unbiased and
// has its variance.
TEST(MisBest, HasTheVarianceOfTheBestTechnique) {
  struct Case {
    const char* problem;
    std::size_t technique;
    int not_covering = -1;
    double tolerance = 0.15;
  };
  // The second technique of D6 has a hole. That of D2 is chosen now and then, since a half may have none of
  // its rare large estimates.
  for (const Case& c : {Case{"D1", 1}, Case{"D2", 0, -1, 0.35}, Case{"D3", 0}, Case{"D5", 1},
                        Case{"D6", 0, 1}, Case{"D7", 1}, Case{"D8", 0}}) {
    const MisProblem p = test::mis_problem(c.problem);
    const double f = test::mis_moments(p).f;
    constexpr int kRuns = 1500, kBatches = 256;
    double sum = 0, squares = 0;
    int right = 0;
    for (std::uint64_t seed = 0; seed < kRuns; ++seed) {
      rng::Stream random(rng::key(20, seed));
      Singles halves[2];
      for (Singles& half : halves)
        for (int t = 0; t < kBatches / 2; ++t) half.add(best_batch(p, random));
      double image = 0;
      for (int half = 0; half < 2; ++half) {
        const auto best = mis::best_technique(p.size(), all_but(p, c.not_covering), halves[1 - half]);
        ASSERT_TRUE(best);
        right += *best == c.technique ? 1 : 0;
        image += halves[half].balance[0] + mis::single_correction(halves[half], best)[0];
      }
      image /= kBatches;
      sum += image;
      squares += image * image;
    }
    const double mean = sum / kRuns, variance = squares / kRuns - mean * mean;
    EXPECT_NEAR(mean, f, 5 * std::sqrt(variance / kRuns)) << c.problem;
    EXPECT_GT(right, 2 * kRuns * 0.85) << c.problem;
    // The tolerance covers the variance of a variance, and wrong choices.
    EXPECT_NEAR(kBatches * variance / table_best(c.problem), 1, c.tolerance) << c.problem;
  }
}

// Claim: a technique that has found nothing yet is not taken for one without noise.
TEST(MisBest, NothingFoundIsNoSmallVariance) {
  Singles sums;
  sums.batches = 4;
  sums.single[0] = {4, 4, 4};  // always 1
  sums.squares[0] = 12;
  sums.balance = {2, 2, 2};  // technique 1 has found nothing
  EXPECT_EQ(mis::best_technique(2, 0b11, sums), 0U);
  EXPECT_EQ(mis::best_technique(2, 0b10, sums), 1U) << "the other one is not eligible";
  EXPECT_FALSE(mis::best_technique(2, 0b11, Singles()));
  EXPECT_EQ(mis::single_correction(sums, std::nullopt)[0], 0) << "the balance heuristic";
}

constexpr std::uint32_t kBestWidth = 5, kBestHeight = 3;
constexpr int kBestFilmScale = 20;

// Claim: read from accumulators, each half of a pixel has the estimate of the technique that the other half
// chose.
TEST(MisBest, DevelopmentReadsAccumulators) {
  const MisProblem p = test::mis_problem("D2");
  WorkPlan plan;
  plan.accumulators = best_technique::accumulators(p.size(), kBestFilmScale);
  plan.development = best_technique::plan(p.size(), 0b101);
  ASSERT_TRUE(check_development(plan).ok()) << check_development(plan).error().to_string();
  std::array<std::vector<film::MergedAccumulator>, 2> sums;
  std::array<std::vector<Singles>, 2> exact;
  for (std::uint32_t half = 0; half < 2; ++half) {
    for (const film::AccumulatorSpec& spec : plan.accumulators)
      sums[half].emplace_back(kBestWidth, kBestHeight, spec);
    for (std::uint32_t y = 0; y < kBestHeight; ++y)
      for (std::uint32_t x = 0; x < kBestWidth; ++x) {
        rng::Stream random(rng::key(21, half, x, y));
        Singles& pixel = exact[half].emplace_back();
        for (int t = 0; t < 16; ++t) pixel.add(best_batch(p, random));
        for (std::size_t i = 0; i < 3; ++i) {
          std::vector<film::Int128> units;
          const double scale = std::ldexp(1.0, plan.accumulators[i].scale_log2);
          for (std::size_t t = 0; i == 0 && t <= p.size(); ++t)
            for (std::size_t k = 0; k < mis::kColors; ++k)
              units.push_back(static_cast<film::Int128>(
                  std::nearbyint((t < p.size() ? pixel.single[t] : pixel.balance)[k] * scale)));
          for (std::size_t t = 0; i == 1 && t < p.size(); ++t)
            units.push_back(static_cast<film::Int128>(std::nearbyint(pixel.squares[t] * scale)));
          if (i == 2) units.push_back(16);
          sums[half][i].set_pixel(x, y, units);
        }
      }
  }
  const auto corrections =
      correct({*plan.development,
               {},
               kBestWidth,
               kBestHeight,
               [&](std::string_view name, std::uint32_t half) -> const film::MergedAccumulator* {
                 for (const auto& a : sums[half])
                   if (a.spec().name == name) return &a;
                 return nullptr;
               }});
  ASSERT_TRUE(corrections.ok()) << corrections.error().to_string();
  for (std::size_t half = 0; half < 2; ++half)
    for (std::size_t i = 0; i < exact[half].size(); ++i) {
      const auto best = mis::best_technique(p.size(), 0b101, exact[1 - half][i]);
      EXPECT_NEAR((*corrections)[half][3 * i], mis::single_correction(exact[half][i], best)[0], 1e-4);
      EXPECT_EQ((*corrections)[half][3 * i + 1], 0);
    }
}

// Claim: a plan whose techniques cannot be read is refused.
TEST(MisBest, PlansAreChecked) {
  for (const char* eligible : {"", "0", "0,0", "1,", ",1", "1,2", "11", "1,1,1", "1,1,1,1,1,1,1,1,1"}) {
    WorkPlan plan;
    plan.accumulators = best_technique::accumulators(2, kBestFilmScale);
    plan.development = best_technique::plan(2, 0b11);
    EXPECT_TRUE(check_development(plan).ok());
    plan.development->constants["eligible"] = eligible;
    EXPECT_FALSE(check_development(plan).ok()) << eligible;
  }
}

}  // namespace
}  // namespace candela
