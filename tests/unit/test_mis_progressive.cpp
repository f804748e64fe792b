// The progressive estimator of optimal multiple importance sampling, as the master makes it: epochs that a
// rule folds, and a development that reads what is folded and what is not.
#include <gtest/gtest.h>

#include <cmath>

#include "common/film/accumulator.h"
#include "common/stages/decision.h"
#include "common/stages/development.h"
#include "common/stages/developments/optimal_mis.h"
#include "common/stages/epoch_corrections.h"
#include "common/stages/epochs.h"
#include "tests/mis_problems.h"
#include "tests/replay.h"

namespace candela {
namespace {

using film::MergedAccumulator;
using PerEpoch = film::AccumulatorSpec::Per;

constexpr std::uint32_t kSide = 6;  // pixels
constexpr int kScaleOfFilm = 20;
constexpr int kEpochBatches[] = {16, 16, 32, 64};  // of both halves

// Every pixel of a film solves the same problem with samples of its own.
struct EpochJob {
  test::MisProblem problem;
  WorkPlan plan;
  std::vector<std::vector<MergedAccumulator>> sums;               // [epoch][accumulator]
  std::vector<std::vector<epoch_corrections::HalfSums>> rounded;  // [epoch][pixel]

  explicit EpochJob(const char* name, std::uint32_t lag = 1) : problem(test::mis_problem(name)) {
    plan.accumulators = pixel_sums::specs(problem.size(), kScaleOfFilm, PerEpoch::epoch);
    plan.development = optimal_mis::plan(optimal_mis::kEpochName, problem.allocation, "progressive");
    plan.epochs = EpochPlan{16,
                            1,
                            lag,
                            std::string(epoch_corrections::kRule),
                            {{"counts", pixel_sums::counts_text(problem.allocation)}}};
    for (std::uint64_t e = 0; e < std::size(kEpochBatches); ++e) add_epoch(e);
  }

  void add_epoch(std::uint64_t epoch) {
    auto& accumulators = sums.emplace_back();
    for (const film::AccumulatorSpec& spec : plan.accumulators) accumulators.emplace_back(kSide, kSide, spec);
    auto& pixels = rounded.emplace_back();
    const std::size_t n = problem.size();
    for (std::uint32_t y = 0; y < kSide; ++y)
      for (std::uint32_t x = 0; x < kSide; ++x) {
        std::vector<film::Int128> matrix, vector;
        const auto units = [](double value, int scale) {
          return static_cast<film::Int128>(std::nearbyint(std::ldexp(value, scale)));
        };
        for (std::uint64_t half = 0; half < 2; ++half) {
          rng::Stream random(rng::key(30, epoch, half, (y << 8) | x));
          const mis::Sums batches = test::mis_batches(problem, kEpochBatches[epoch] / 2, random);
          for (std::size_t i = 0; i < mis::packed_size(n); ++i)
            matrix.push_back(units(batches.a[i], plan.accumulators[0].scale_log2));
          for (std::size_t k = 0; k < mis::kColors; ++k)
            for (std::size_t i = 0; i < n; ++i)
              vector.push_back(units(batches.b[k][i], plan.accumulators[1].scale_log2));
        }
        accumulators[0].set_pixel(x, y, matrix);
        accumulators[1].set_pixel(x, y, vector);
        epoch_corrections::HalfSums& pixel = pixels.emplace_back();
        for (std::uint32_t half = 0; half < 2; ++half)
          pixel[half] = pixel_sums::read(&accumulators[0], &accumulators[1], x, y, n, half);
      }
  }

  // Read after so many decisions; sums of epochs from `end` on have not come yet.
  Corrections image(std::string_view estimator, std::uint64_t decisions, std::size_t end) const {
    const auto replayed = replay(*plan.epochs, plan.accumulators, decisions, kSide, kSide,
                                 [&](std::string_view name, std::uint64_t epoch) {
                                   return &sums[epoch][name == pixel_sums::kMatrix ? 0 : 1];
                                 });
    EXPECT_TRUE(replayed.ok()) << replayed.error().to_string();
    DevelopmentInput input{*plan.development, estimator, kSide, kSide,
                           [](std::string_view, std::uint32_t) { return nullptr; }};
    if (decisions > 0) input.carry = &replayed->carry;
    for (std::size_t e = epochs_folded(decisions); e < end; ++e)
      input.open.push_back({&sums[e][0], &sums[e][1]});
    auto corrections = correct(std::move(input));
    EXPECT_TRUE(corrections.ok()) << corrections.error().to_string();
    return corrections.ok() ? *corrections : Corrections();
  }
  std::size_t epochs_folded(std::uint64_t decisions) const {
    return candela::epochs_folded(decisions, plan.epochs->lag);
  }
};

// Claim: the image is that of mis::progressive on the same sums, with the first epoch as the balance
// heuristic has it, however many of its epochs are folded, for every lag.
TEST(MisProgressive, IsTheFormula) {
  for (const std::uint32_t lag : {0U, 1U, 2U}) {
    const EpochJob job("D1", lag);
    ASSERT_TRUE(check_development(job.plan).ok()) << check_development(job.plan).error().to_string();
    const std::size_t end = std::size(kEpochBatches);
    const Corrections unfolded = job.image("progressive", 0, end);
    for (std::size_t pixel = 0; pixel < std::size_t{kSide} * kSide; ++pixel) {
      std::vector<mis::Sums> epochs;
      for (const auto& epoch : job.rounded) {
        epochs.push_back(epoch[pixel][0]);
        epochs.back().add(epoch[pixel][1]);
      }
      const double expected = mis::progressive(job.problem.allocation, epochs, pixel_sums::kMatrixScale)[0];
      ASSERT_NE(expected, 0);
      EXPECT_NEAR(unfolded[0][3 * pixel] + unfolded[1][3 * pixel], expected, 1e-5 * (1 + std::abs(expected)));
    }
    for (std::uint64_t decisions = 1; decisions <= end + lag; ++decisions)
      EXPECT_EQ(job.image("progressive", decisions, end), unfolded) << decisions << " decisions, lag " << lag;
    for (const auto& half : job.image("progressive", 1, 1))
      for (const float value : half) EXPECT_EQ(value, 0) << "the first epoch is the balance heuristic's";
  }
}

// Claim: the same job is read by crossfit and direct too, as a job without epochs with the same sums.
TEST(MisProgressive, OffersTheOtherEstimators) {
  const EpochJob job("D2");
  const std::size_t end = std::size(kEpochBatches);
  const Corrections crossfit = job.image("crossfit", 4, end), direct = job.image("direct", 4, end);
  for (std::size_t pixel = 0; pixel < std::size_t{kSide} * kSide; ++pixel) {
    epoch_corrections::HalfSums all;
    for (const auto& epoch : job.rounded)
      for (std::size_t half = 0; half < 2; ++half) all[half].add(epoch[pixel][half]);
    const auto c = mis::crossfit_halves(job.problem.allocation, all[0], all[1], pixel_sums::kMatrixScale);
    const auto d = mis::direct_halves(job.problem.allocation, all[0], all[1], pixel_sums::kMatrixScale);
    for (std::size_t half = 0; half < 2; ++half) {
      EXPECT_FLOAT_EQ(crossfit[half][3 * pixel], static_cast<float>(c[half][0]));
      EXPECT_FLOAT_EQ(direct[half][3 * pixel], static_cast<float>(d[half][0]));
    }
  }
  for (const auto& half : job.image("balance", 4, end)) EXPECT_TRUE(half.empty());
}

// Claim: a job without epochs refuses the estimator and says which it has; plans whose epochs do not fit are
// refused.
TEST(MisProgressive, NeedsEpochs) {
  const auto fault = [](void (*spoil)(WorkPlan&)) {
    WorkPlan plan = EpochJob("D3").plan;
    spoil(plan);
    return !check_development(plan).ok();
  };
  EXPECT_FALSE(fault([](WorkPlan&) {}));
  EXPECT_TRUE(fault([](WorkPlan& p) { p.epochs.reset(); }));
  EXPECT_TRUE(fault([](WorkPlan& p) { p.epochs->rule = "fppm"; }));
  EXPECT_TRUE(fault([](WorkPlan& p) { p.epochs->constants["counts"] = "1,2"; }));
  EXPECT_TRUE(fault([](WorkPlan& p) { p.development->constants["counts"] = "1"; }));
  EXPECT_TRUE(fault([](WorkPlan& p) { p.accumulators.pop_back(); }));
  EXPECT_TRUE(fault([](WorkPlan& p) { p.accumulators[0].per = PerEpoch::job; }));
  EXPECT_TRUE(fault([](WorkPlan& p) { p.development->name = optimal_mis::kName; }));
}

}  // namespace
}  // namespace candela
