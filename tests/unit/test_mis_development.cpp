// The image of optimal multiple importance sampling from film and accumulators, as the master makes it.
#include <gtest/gtest.h>

#include <cmath>

#include "common/film/accumulator.h"
#include "common/film/delta.h"
#include "common/film/development.h"
#include "common/film/unit_film.h"
#include "common/stages/development.h"
#include "common/stages/developments/optimal_mis.h"
#include "common/stats/image_error.h"
#include "tests/mis_problems.h"

namespace candela {
namespace {

constexpr std::uint32_t kWidth = 40, kHeight = 35;  // tiles that are cut
constexpr int kFilmScale = 20;

WorkPlan plan_of(const test::MisProblem& p, std::string_view estimator) {
  WorkPlan plan;
  plan.accumulators = pixel_sums::specs(p.size(), kFilmScale);
  plan.development = optimal_mis::plan(p.allocation, estimator);
  return plan;
}

// Every pixel of a film solves the same problem with samples of its own.
struct Job {
  test::MisProblem problem;
  WorkPlan plan;
  film::MergedFilm film{{kWidth, kHeight, 1}, kFilmScale};
  std::array<std::array<film::MergedAccumulator, 2>, 2> sums;  // [accumulator][half]

  explicit Job(const char* name)
      : problem(test::mis_problem(name)),
        plan(plan_of(problem, "crossfit")),
        sums{{{empty(0), empty(0)}, {empty(1), empty(1)}}} {}
  film::MergedAccumulator empty(std::size_t i) const { return {kWidth, kHeight, plan.accumulators[i]}; }

  // Merges the unit of one iteration; a pixel may draw nothing in it.
  void merge(std::uint32_t half, std::uint64_t index, bool gaps) {
    film::UnitFilm unit({kWidth, kHeight, 1}, kFilmScale);
    film::UnitAccumulator matrix(kWidth, kHeight, plan.accumulators[0]);
    film::UnitAccumulator vector(kWidth, kHeight, plan.accumulators[1]);
    film::SampleCounts sample_counts;
    for (std::uint32_t y = 0; y < kHeight; ++y)
      for (std::uint32_t x = 0; x < kWidth; ++x) {
        const std::uint64_t key = rng::key(half, index, x, y);
        rng::Stream random(key);
        if (gaps && random.next_double() < 0.5) continue;
        const mis::Sums batch = test::mis_batch(problem, random);
        const auto f = static_cast<float>(batch.balance_sum(problem.allocation, 0));
        unit.add(0, x, y, {f, f / 2, 0}, key, sample_counts);
        matrix.add(x, y, 0, std::span(batch.a).first(mis::packed_size(problem.size())), key, sample_counts);
        std::array<double, mis::kColors * mis::kMaxTechniques> b{};
        for (std::size_t i = 0; i < problem.size(); ++i) {
          b[i] = batch.b[0][i];
          b[problem.size() + i] = batch.b[0][i] / 2;
        }
        vector.add(x, y, 0, std::span(b).first(mis::kColors * problem.size()), key, sample_counts);
      }
    unit.count(sample_counts);
    film::DeltaWriter writer({{Unit::Kind::iterations, half, index, index + 1}, {}, 0, "j", "b"});
    writer.film(unit);
    writer.accumulator(matrix, 0);
    writer.accumulator(vector, 0);
    writer.counts(sample_counts);
    const auto delta = film::Delta::decode(writer.finish(), {{kWidth, kHeight, 1}, plan.accumulators});
    ASSERT_TRUE(delta.ok()) << delta.error().to_string();
    ASSERT_TRUE(film.merge(*delta).ok());
    for (std::size_t i = 0; i < 2; ++i) sums[i][half].merge(delta->accumulators()[i].sums);
  }

  DevelopmentInput input(std::string_view estimator) const {
    return {*plan.development, estimator, kWidth, kHeight, [this](std::string_view name, std::uint32_t half) {
              return &sums[name == pixel_sums::kMatrix ? 0 : 1][half];
            }};
  }
  film::Development development(std::string_view estimator) const {
    auto corrections = correct(input(estimator));
    EXPECT_TRUE(corrections.ok());
    film::Development out;
    for (std::size_t half = 0; half < 2; ++half)
      if (!(*corrections)[half].empty())
        out.corrections[half] = std::make_shared<const std::vector<float>>(std::move((*corrections)[half]));
    return out;
  }
};

// Mean and standard error of a color over the pixels of an image.
std::pair<double, double> mean_of(const std::vector<float>& image, std::size_t color) {
  double sum = 0, squares = 0;
  for (std::size_t i = color; i < image.size(); i += 3) {
    sum += static_cast<double>(image[i]);
    squares += static_cast<double>(image[i]) * static_cast<double>(image[i]);
  }
  const double n = static_cast<double>(image.size() / 3), mean = sum / n;
  return {mean, std::sqrt((squares / n - mean * mean) / n)};
}

// Claim: balance is the film to the bit; crossfit is unbiased and much less noisy where that is to be had,
// with and without iterations in which a pixel draws nothing; the error estimate is of the image that is
// given out. Five standard errors: an alarm in 1e-6 seeds.
TEST(MisDevelopment, ReadsOneJobInSeveralWays) {
  for (const bool gaps : {false, true}) {
    Job job("D1");
    for (std::uint64_t i = 0; i < 16; ++i)
      for (const std::uint32_t half : {0U, 1U}) job.merge(half, i, gaps);
    const auto balance = job.development("balance"), crossfit = job.development("crossfit");
    const std::vector<float> plain = film::develop_image(job.film, balance);
    EXPECT_EQ(plain, job.film.develop(0));
    const std::vector<float> image = film::develop_image(job.film, crossfit);
    const double f = 0.340846481668729 * (gaps ? 0.5 : 1);
    for (std::size_t color = 0; color < 3; ++color) {
      const auto [mean, error] = mean_of(image, color);
      EXPECT_NEAR(mean, f * (color == 0 ? 1 : color == 1 ? 0.5 : 0), 5 * error + 1e-7) << color << gaps;
    }
    const double gain = mean_of(plain, 0).second / mean_of(image, 0).second;
    // Without gaps sqrt(34 / 1.04) in the limit. Which iterations draw nothing is noise that no weight
    // removes.
    EXPECT_GT(gain, gaps ? 1.01 : 4.5);
    const std::vector<float> halves[] = {
        film::develop_image(job.film, crossfit, film::MergedFilm::Which::half0),
        film::develop_image(job.film, crossfit, film::MergedFilm::Which::half1)};
    for (std::size_t i = 0; i < image.size(); ++i)
      ASSERT_NEAR(image[i], (halves[0][i] + halves[1][i]) / 2, 1e-6) << "the whole is the mean of its halves";
    const double stated = stats::estimate_error(job.film, crossfit).rmse;
    double squares = 0;
    for (std::size_t i = 0; i < image.size(); i += 3) squares += std::pow(image[i] - f, 2);
    const double rmse = std::sqrt(squares / (static_cast<double>(image.size()) / 3));
    // Three colors, one half as bright and one black.
    EXPECT_NEAR(stated, rmse * std::sqrt((1 + 0.25) / 3), 0.1 * rmse);
  }
}

// Claim: the order of merging, and the grouping into units, change no bit of the image.
TEST(MisDevelopment, OrderDoesNotMatter) {
  Job forward("D7"), backward("D7");
  for (std::uint64_t i = 0; i < 4; ++i) {
    for (const std::uint32_t half : {0U, 1U}) forward.merge(half, i, true);
    for (const std::uint32_t half : {1U, 0U}) backward.merge(half, 3 - i, true);
  }
  for (const std::string_view estimator : optimal_mis::kEstimators)
    EXPECT_EQ(film::develop_image(forward.film, forward.development(estimator)),
              film::develop_image(backward.film, backward.development(estimator)));
}

// Claim: rounding keeps a pixel's count of samples within M^3 T 2^-(k+1) of the truth.
TEST(MisDevelopment, MatrixCountsSamples) {
  Job job("D5");
  for (std::uint64_t i = 0; i < 8; ++i) job.merge(0, i, false);
  for (std::uint32_t x = 0; x < kWidth; ++x) {
    mis::Sums sums;
    for (std::uint32_t i = 0; i < 3; ++i)
      sums.a[i] =
          static_cast<double>(job.sums[0][0].sum(x, 7, i)) * std::ldexp(1.0, -pixel_sums::kMatrixScale);
    EXPECT_NEAR(sums.samples(job.problem.allocation), 24,
                2 * 27.0 * 8 * std::ldexp(1.0, -pixel_sums::kMatrixScale - 1));
  }
}

// Claim: a plan with an unknown rule, estimator or counts, or without the accumulators that its rule reads,
// is refused; so is an estimator that a job does not offer, with the names of those it does.
TEST(MisDevelopment, PlansAreChecked) {
  const auto fault = [](void (*spoil)(WorkPlan&)) {
    WorkPlan plan = plan_of(test::mis_problem("D1"), "crossfit");
    spoil(plan);
    return !check_development(plan).ok();
  };
  EXPECT_FALSE(fault([](WorkPlan&) {}));
  EXPECT_FALSE(fault([](WorkPlan& p) { p.development.reset(); }));
  EXPECT_TRUE(fault([](WorkPlan& p) { p.development->name = "other"; }));
  EXPECT_TRUE(fault([](WorkPlan& p) { p.development->constants["estimator"] = "fan"; }));
  EXPECT_TRUE(fault([](WorkPlan& p) { p.development->constants.erase("estimator"); }));
  EXPECT_TRUE(fault([](WorkPlan& p) { p.accumulators.pop_back(); }));
  EXPECT_TRUE(fault([](WorkPlan& p) { p.accumulators[0].channels = 5; }));
  for (const char* counts : {"", "1,1", "1,1,1,1", "1,1,x", "1,1,0", "1,,1", "1,1,1,1,1,1,1,1,1", "1,1,-1"}) {
    WorkPlan plan = plan_of(test::mis_problem("D1"), "crossfit");
    plan.development->constants["counts"] = counts;
    EXPECT_FALSE(check_development(plan).ok()) << counts;
  }
  const Job job("D1");
  const auto refused = correct(job.input("progressive"));
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().field, "estimator");
  EXPECT_NE(refused.error().to_string().find("crossfit, direct, balance"), std::string::npos);
}

}  // namespace
}  // namespace candela
