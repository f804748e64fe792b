// Estimators of optimal multiple importance sampling on sampled batches. Seeds are fixed. Each statistical
// comparison is at five standard errors: all of them together alarm with probability below 1e-4 over seeds.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "common/mis/batch.h"
#include "common/rng/stream.h"
#include "tests/mis_estimators.h"
#include "tests/mis_problems.h"

namespace candela {
namespace {

using mis::Allocation;
using mis::Sums;
using test::MisProblem;

constexpr int kScale = 40;  // of sums that were not rounded: a ridge far below any noise
constexpr double kSigmas = 5;

struct Mean {
  double sum = 0, squares = 0;
  int count = 0;
  void add(double x) {
    sum += x;
    squares += x * x;
    ++count;
  }
  double mean() const { return sum / count; }
  double variance() const { return (squares - sum * sum / count) / (count - 1); }
  double error() const { return std::sqrt(variance() / count); }
};

double estimate(const Allocation& n, const Sums& sums, const mis::Slopes& slopes, double batches) {
  return (sums.balance_sum(n, 0) + mis::correction(n, sums, slopes)[0]) / batches;
}
double direct_without_ridge(const Allocation& n, const Sums& sums, double batches) {
  return estimate(n, sums, mis::solve(n, sums, 0), batches);
}
double crossfit_image(const Allocation& n, const Sums& a, const Sums& b, double batches) {
  return (a.balance_sum(n, 0) + b.balance_sum(n, 0) + mis::crossfit(n, a, b, kScale)[0]) / batches;
}
mis::Slopes exact_slopes(const MisProblem& p) {
  return mis::solve(p.allocation, test::mis_moments(p).sums, 0);
}

template <std::size_t kTechniques>
void sums_of_known_count() {
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    rng::Stream random(rng::key(seed, kTechniques));
    mis::Batch batch;
    for (std::size_t s = 0; s < kTechniques; ++s) {
      for (std::size_t i = 0; i < kTechniques; ++i)
        batch.samples[s].c[i] = random.next_u32() % 4 == 0 ? 0 : random.next_double();
      for (double& f : batch.samples[s].f_over_q) f = random.next_u32() % 4 == 0 ? 0 : random.next_double();
    }
    const Sums sums = mis::sums_of(kTechniques, batch);
    const auto a = mis::matrix_of<kTechniques>(batch);
    for (std::size_t i = 0; i < mis::packed_size(kTechniques); ++i) EXPECT_EQ(a[i], sums.a[i]) << i;
    const auto b = mis::vector_of<kTechniques>(batch);
    for (std::size_t k = 0; k < mis::kColors; ++k)
      for (std::size_t i = 0; i < kTechniques; ++i) EXPECT_EQ(b[k * kTechniques + i], sums.b[k][i]);
  }
}

// Claim: the sums of one batch by whole registers are those of sample after sample, to the last bit.
TEST(MisEstimators, BatchesOfKnownCounts) {
  sums_of_known_count<2>();
  sums_of_known_count<3>();
  sums_of_known_count<4>();
  sums_of_known_count<5>();
  sums_of_known_count<8>();
}

// Claim: the controls of every sample add up to one, and a pixel's matrix counts its samples.
TEST(MisEstimators, ControlsAddUp) {
  for (const char* name : {"D1", "D2", "D5", "D6", "D7", "D8"}) {
    const MisProblem p = test::mis_problem(name);
    rng::Stream random(rng::key(1));
    for (int i = 0; i < 1000; ++i) {
      const mis::Controls c = mis::controls(p.allocation, p.densities(random.next_double()));
      double sum = 0;
      for (std::size_t k = 0; k < p.size(); ++k) sum += p.allocation.counts[k] * c.c[k];
      EXPECT_NEAR(sum, 1, 1e-14);
    }
    const int batches = 100;
    const double samples = test::mis_batches(p, batches, random).samples(p.allocation);
    EXPECT_NEAR(samples, batches * p.allocation.total(), 1e-10);
  }
}

// Claim: densities far beyond the range of floats give the same controls as small ones.
TEST(MisEstimators, DensitiesOfAnySize) {
  const Allocation n = Allocation::ones(2);
  const std::array<double, 2> plain = {1, 3};
  const mis::Controls expected = mis::controls(n, plain);
  for (const double scale : {1e-300, 1e300}) {
    const std::array<double, 2> p = {scale, 3 * scale};
    const mis::Controls c = mis::controls(n, p);
    EXPECT_NEAR(c.c[0], expected.c[0], 1e-15);
    EXPECT_NEAR(c.over_q(scale), expected.over_q(1), 1e-15);
  }
}

// Claim: where f is a combination of the densities, four batches give it exactly, for every seed; and slopes
// that differ by a multiple of the allocation give the same image.
TEST(MisEstimators, CombinationsOfDensitiesAreExact) {
  const MisProblem p = test::mis_problem("D3");
  for (std::uint64_t seed = 0; seed < 20000; ++seed) {
    rng::Stream random(rng::key(2, seed));
    const Sums sums = test::mis_batches(p, 4, random);
    const double f = direct_without_ridge(p.allocation, sums, 4);
    ASSERT_NEAR(f, 0.5, 1e-12) << seed;
    if (seed >= 100) continue;
    for (const double s : {1.0, -1e3}) {
      mis::Slopes slopes = mis::solve(p.allocation, sums, 0);
      for (std::size_t i = 0; i < p.size(); ++i) slopes[0][i] += s * p.allocation.counts[i];
      ASSERT_NEAR(estimate(p.allocation, sums, slopes, 4), f, 1e-12 * (1 + std::abs(s)));
    }
  }
}

// Claim: the direct estimator is biased by what theory computed; crossfit and progressive are not.
TEST(MisEstimators, BiasIsSeenAndAbsent) {
  struct Case {
    const char* problem;
    double direct_mean, standard_error;
  };
  for (const Case& c : {Case{"D2", .347061, .000082}, Case{"D5", 1.158300, .000039}}) {
    const MisProblem p = test::mis_problem(c.problem);
    const double f = test::mis_moments(p).f;
    const mis::Slopes exact = exact_slopes(p);
    Mean direct, cross, progressive;
    for (std::uint64_t seed = 0; seed < 40000; ++seed) {
      rng::Stream random(rng::key(3, seed));
      constexpr int kBatches = 16;
      const Sums epochs[] = {test::mis_batches(p, 4, random), test::mis_batches(p, 4, random),
                             test::mis_batches(p, 8, random)};
      Sums first = epochs[0], all;
      first.add(epochs[1]);
      for (const Sums& e : epochs) all.add(e);
      // The estimate with exact slopes is unbiased, and takes most of the noise out of the differences.
      const double paired = estimate(p.allocation, all, exact, kBatches);
      direct.add(direct_without_ridge(p.allocation, all, kBatches) - paired);
      cross.add(crossfit_image(p.allocation, first, epochs[2], kBatches) - paired);
      progressive.add((all.balance_sum(p.allocation, 0) + mis::progressive(p.allocation, epochs, kScale)[0]) /
                          kBatches -
                      paired);
    }
    EXPECT_NEAR(f + direct.mean(), c.direct_mean, kSigmas * std::hypot(direct.error(), c.standard_error));
    EXPECT_GT(direct.mean(), 2 * kSigmas * direct.error()) << "the test must see this bias";
    EXPECT_LT(std::abs(cross.mean()), kSigmas * cross.error());
    EXPECT_LT(std::abs(progressive.mean()), kSigmas * progressive.error());
  }
}

// Claim: the bias of the direct estimator falls as one over the number of batches, by what theory computed
// for 128 of them.
TEST(MisEstimators, DirectBiasFalls) {
  struct Case {
    const char* problem;
    double bias, standard_error;
  };
  for (const Case& c : {Case{"D2", 6.74e-4, 8e-6}, Case{"D5", 3.81e-4, 5e-6}}) {
    const MisProblem p = test::mis_problem(c.problem);
    const mis::Slopes exact = exact_slopes(p);
    constexpr int kBatches = 128;
    Mean direct;
    for (std::uint64_t seed = 0; seed < 10000; ++seed) {
      rng::Stream random(rng::key(13, seed));
      const Sums all = test::mis_batches(p, kBatches, random);
      direct.add(direct_without_ridge(p.allocation, all, kBatches) -
                 estimate(p.allocation, all, exact, kBatches));
    }
    EXPECT_NEAR(direct.mean(), c.bias, kSigmas * std::hypot(direct.error(), c.standard_error)) << c.problem;
    EXPECT_GT(direct.mean(), 2 * kSigmas * direct.error()) << "the test must see this bias";
  }
}

// Claim: crossfit is nearly optimal from 32 batches on, and costs little where there is nothing to gain.
TEST(MisEstimators, VarianceOfCrossfit) {
  const auto variance = [](const MisProblem& p, int batches, int runs) {
    Mean mean;
    for (int run = 0; run < runs; ++run) {
      rng::Stream random(rng::key(4, run, batches));
      const Sums a = test::mis_batches(p, batches / 2, random), b = test::mis_batches(p, batches / 2, random);
      mean.add(crossfit_image(p.allocation, a, b, batches));
    }
    return batches * mean.variance();
  };
  const double of_d1 = variance(test::mis_problem("D1"), 32, 40000) / 0.000394390693954996;
  std::printf("T x variance of crossfit over the optimal one, D1, T = 32: %.3f\n", of_d1);
  EXPECT_NEAR(of_d1, 1.04, 0.03);
  const double balance = 0.0317045071955307;
  for (const int batches : {2, 4, 8}) {
    const double of_d7 = variance(test::mis_problem("D7"), batches, 20000) / balance;
    std::printf("T x variance of crossfit over that of balance, D7, T = %d: %.3f\n", batches, of_d7);
    EXPECT_LT(of_d7, 1.6) << batches;
  }
}

// Claim: omissions of the control variate change the mean by what theory computed, and the estimator without
// them does not: dark samples and failures left out, a wrong sign, densities that mix two conventions of
// occlusion.
TEST(MisEstimators, PlantedBugsAreSeen) {
  // D5 is dark below 0.3.
  const MisProblem dark = test::mis_problem("D5"), failing = test::mis_problem("D7");
  const mis::Slopes dark_slopes = [&] {
    mis::Slopes s = exact_slopes(dark);
    const double missing = (1.155 - s[0][0] - s[0][1]) / dark.allocation.total();
    for (std::size_t i = 0; i < 2; ++i) s[0][i] += missing * dark.allocation.counts[i];
    return s;
  }();
  Mean skipped, wrong_sign, whole, mixed, first_control, second_control, unfailed;
  for (std::uint64_t seed = 0; seed < 200000; ++seed) {
    rng::Stream random(rng::key(5, seed));
    const mis::Vector& alpha = dark_slopes[0];
    double sum_skipped = 0, sum_sign = 0, sum_whole = 0;
    mis::Vector r{};
    double f_balance = 0;
    for (std::size_t i = 0; i < 2; ++i)
      for (int n = 0; n < static_cast<int>(dark.allocation.counts[i]); ++n) {
        const double x = dark.techniques[i].sample(random.next_double());
        const mis::Controls c = mis::controls(dark.allocation, dark.densities(x));
        const double value = c.over_q(dark.f(x)), control = alpha[0] * c.c[0] + alpha[1] * c.c[1];
        sum_skipped += value - (value != 0 ? control : 0);
        sum_sign += value + control;
        sum_whole += value - control;
        // Technique 1 cannot reach x < 0.3; technique 2's samples there use its density all the same.
        const mis::Vector used = i == 0 && x < 0.3 ? mis::controls_of_one(dark.allocation, 0) : c.c;
        for (std::size_t k = 0; k < 2; ++k) r[k] += used[k];
        f_balance += value;
      }
    const double sum_alpha = alpha[0] + alpha[1];
    skipped.add(sum_alpha + sum_skipped);
    wrong_sign.add(sum_alpha + sum_sign);
    whole.add(sum_alpha + sum_whole);
    mixed.add(f_balance + alpha[0] * (1 - r[0]) + alpha[1] * (1 - r[1]));
    first_control.add(r[0]);
    second_control.add(r[1]);
    double unfailed_sum = 0.151449267 + 0.189397215;
    for (std::size_t i = 0; i < 2; ++i) {
      const double x = failing.techniques[i].sample(random.next_double());
      if (random.next_double() < failing.techniques[i].fail) continue;  // no control variate
      const mis::Controls c = mis::controls(failing.allocation, failing.densities(x));
      unfailed_sum += c.over_q(failing.f(x)) - 0.151449267 * c.c[0] - 0.189397215 * c.c[1];
    }
    unfailed.add(unfailed_sum);
  }
  const auto expect = [](const Mean& m, double value) { EXPECT_NEAR(m.mean(), value, kSigmas * m.error()); };
  expect(skipped, 1.235608274);
  expect(wrong_sign, 3.465);
  expect(whole, 1.155);
  expect(mixed, 1.254488);
  expect(unfailed, 0.397665646);
  expect(first_control, 1.037636);
  expect(second_control, 0.924729);
  for (const auto* bug : {&skipped, &wrong_sign, &mixed})
    EXPECT_GT(std::abs(bug->mean() - 1.155), 2 * kSigmas * bug->error()) << "the test must see this bug";

  // Failures left out of the matrix: the system's solution in the limit.
  test::MisMoments m = test::mis_moments(failing);
  m.sums.a[mis::packed(1, 1)] -= failing.techniques[1].fail;
  const double a = m.sums.a[0], b = m.sums.a[1], d = m.sums.a[2];
  const double sum_of_slopes = ((d - b) * m.sums.b[0][0] + (a - b) * m.sums.b[0][1]) / (a * d - b * b);
  EXPECT_NEAR(sum_of_slopes, 0.490060078, 1e-8);
}

// Claim: averaging the estimates of workers keeps the bias of a worker's few batches; merging sums does not.
TEST(MisEstimators, EstimatesDoNotAverage) {
  const MisProblem p = test::mis_problem("D1");
  const mis::Slopes exact = exact_slopes(p);
  Mean averaged, merged;
  for (std::uint64_t seed = 0; seed < 4000; ++seed) {
    rng::Stream random(rng::key(6, seed));
    Sums all;
    double sum = 0;
    for (int worker = 0; worker < 32; ++worker) {
      const Sums sums = test::mis_batches(p, 2, random);
      sum += direct_without_ridge(p.allocation, sums, 2);
      all.add(sums);
    }
    const double paired = estimate(p.allocation, all, exact, 64);
    averaged.add(sum / 32 - paired);
    merged.add(direct_without_ridge(p.allocation, all, 64) - paired);
  }
  EXPECT_NEAR(averaged.mean(), -2.3e-3, 0.1e-3 + kSigmas * averaged.error());
  EXPECT_NEAR(merged.mean(), -6.7e-5, 0.1e-5 + kSigmas * merged.error());
}

// Claim: techniques that are nearly or wholly the same leave the balance heuristic's image as it is.
TEST(MisEstimators, DependentTechniquesChangeNothing) {
  for (const double delta : {1e-3, 1e-8, 0.0}) {
    MisProblem p = test::mis_problem("D3");
    p.f = test::mis_problems::lobe;
    p.techniques = {test::mis_problems::uniform(),
                    {[=](double x) { return 1 + delta * (2 * x - 1); }, [](double u) { return u; }, 0}};
    rng::Stream random(rng::key(7));
    const Sums a = test::mis_batches(p, 2048, random), b = test::mis_batches(p, 2048, random);
    // At 1e-3 so many batches know the slope well enough to use it.
    if (delta < 1e-6) {
      EXPECT_LT(std::abs(mis::crossfit(p.allocation, a, b, kScale)[0]) / 4096, 1e-12) << delta;
    }
    const double scale = delta > 1e-6 ? 1e-6 : 1e-12;
    Sums all = a;
    all.add(b);
    EXPECT_LT(std::abs(mis::correction(p.allocation, all, mis::solve(p.allocation, all, 1))[0]) / 4096,
              scale);
  }
}

// Claim: a color's image depends on no other color; brighter light gives a brighter image, and nothing else
// changes.
TEST(MisEstimators, ColorsAndBrightness) {
  const MisProblem p = test::mis_problem("D1");
  rng::Stream random(rng::key(8));
  Sums half[2] = {test::mis_batches(p, 8, random), test::mis_batches(p, 8, random)};
  for (Sums& sums : half)
    for (std::size_t i = 0; i < p.size(); ++i) {
      sums.b[1][i] = 1e-4 * sums.b[0][i];
      sums.b[2][i] = 1e6 * sums.b[0][i];
    }
  const mis::Color c = mis::crossfit(p.allocation, half[0], half[1], kScale);
  ASSERT_NE(c[0], 0);
  EXPECT_NEAR(c[1], 1e-4 * c[0], 1e-16 * std::abs(c[0]));
  EXPECT_NEAR(c[2], 1e6 * c[0], 1e-6 * std::abs(c[0]));
}

// Claim: a ridge that dominates, a single technique, no batches and black sums all give the balance
// heuristic.
TEST(MisEstimators, FallBackToBalance) {
  const MisProblem p = test::mis_problem("D1");
  rng::Stream random(rng::key(9));
  const Sums sums = test::mis_batches(p, 16, random);
  EXPECT_LT(std::abs(mis::correction(p.allocation, sums, mis::solve(p.allocation, sums, 1e15))[0]), 1e-12);
  EXPECT_EQ(mis::crossfit(p.allocation, sums, Sums(), kScale)[0], 0);
  EXPECT_EQ(mis::crossfit(p.allocation, Sums(), Sums(), kScale)[0], 0);
  const Sums one = test::mis_batch(p, random);
  EXPECT_EQ(mis::direct(p.allocation, std::array{one}, kScale)[0], 0);
  Sums black = sums;
  black.b = {};
  EXPECT_EQ(mis::direct(p.allocation, std::array{black}, kScale)[0], 0);
  MisProblem single = test::mis_problem("D3");
  single.techniques.resize(1);
  single.allocation = Allocation::ones(1);
  EXPECT_EQ(mis::direct(single.allocation, std::array{test::mis_batches(single, 16, random)}, kScale)[0], 0);
}

// Claim: rounding of the sums to 2^-20 changes an image by less than a tenth of a thousandth of its noise.
TEST(MisEstimators, RoundingIsHarmless) {
  const MisProblem p = test::mis_problem("D1");
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    rng::Stream random(rng::key(10, seed));
    constexpr int kBatches = 1024, kBits = 20;
    const Sums exact = test::mis_batches(p, kBatches, random);
    Sums rounded = exact;
    // As a sum of that many rounded entries has it.
    const double sigma = std::sqrt(kBatches * 3 / 12.0) * std::ldexp(1.0, -kBits);
    const auto noise = [&] {
      double sum = 0;
      for (int i = 0; i < 12; ++i) sum += random.next_double();
      return sigma * (sum - 6);
    };
    for (double& a : rounded.a) a += noise();
    const double f = estimate(p.allocation, exact, mis::solve(p.allocation, exact, 1.0 / kBatches), kBatches);
    const mis::Slopes slopes = mis::solve(p.allocation, rounded, 1.0 / kBatches);
    EXPECT_NEAR(
        (exact.balance_sum(p.allocation, 0) + mis::correction(p.allocation, rounded, slopes)[0]) / kBatches,
        f, 5e-6);
    EXPECT_NEAR(rounded.samples(p.allocation), kBatches * 3, 12 * 3 * sigma);
  }
}

// Claim: sums add in any grouping to the same estimate within rounding of doubles.
TEST(MisEstimators, SumsMerge) {
  const MisProblem p = test::mis_problem("D7");
  rng::Stream random(rng::key(12));
  std::vector<Sums> parts;
  for (int i = 0; i < 16; ++i) parts.push_back(test::mis_batch(p, random));
  Sums forward, backward;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    forward.add(parts[i]);
    backward.add(parts[parts.size() - 1 - i]);
  }
  EXPECT_NEAR(mis::direct(p.allocation, std::array{forward}, kScale)[0],
              mis::direct(p.allocation, std::array{backward}, kScale)[0], 1e-12);
  EXPECT_NEAR(mis::direct(p.allocation, parts, kScale)[0],
              mis::direct(p.allocation, std::array{forward}, kScale)[0], 1e-12);
}

}  // namespace
}  // namespace candela
