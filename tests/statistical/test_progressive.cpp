// The radius schedule of progressive photon mapping, measured on a picture whose expectation and variance are
// known in closed form at every radius: a matt floor under a point light of intensity I at height 1, seen
// right below the light. A photon leaves in a uniform direction and lands within r of that point with
// probability
//
//   p(r) = (1 - 1 / sqrt(1 + r^2)) / 2,
//
// so that an iteration of n photons and radius r, with the constant kernel, has the mean and the variance
//
//   L 4 p(r) / r^2,      L^2 (4 / r^2)^2 p (1 - p) / n,      L = I reflectance / pi (the limit of small
//   radii),
//
// (binomial; with the independent sampler). Of N iterations with r_i^2 = r_0^2 prod (k + alpha) / (k + 1)
// [Knaus 2011] the mean's bias falls as N^-(1-alpha) and its variance as N^-alpha. Each of fewer than
// 60 comparisons alarms falsely with probability at most 1e-5: the file with at most 6e-4.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <thread>

#include "tests/proofs/proofs.h"
#include "tests/statistical/extrapolation.h"
#include "tests/statistical/harness.h"
#include "tests/statistical/quantiles.h"

namespace candela::statistical {
namespace {

// Films decide these tests: proofs.h.
const proofs::FilmsDecide kFilms({"Progressive"});

constexpr double kAlarm = 1e-5;

// The floor's half side; the scene's bounding radius is sqrt(2) of it.
constexpr double kFloor = 10;
constexpr double kFirstRadius = 0.5;
constexpr double kIntensity = 3, kReflectance = 0.5;
constexpr int kPhotons = 64;

const std::string kScene = fmt::format(
    R"(<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="2"/></integrator>
    <sensor type="perspective"><float name="fov" value="0.01"/>
      <transform name="to_world"><lookat origin="0, 3, 0" target="0, 0, 0" up="0, 0, 1"/></transform></sensor>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="{}"/></transform>
      <bsdf type="diffuse"><rgb name="reflectance" value="{}"/></bsdf></shape>
    <emitter type="point"><point name="position" x="0" y="1" z="0"/><rgb name="intensity" value="{}"/></emitter></scene>)",
    kFloor, kReflectance, kIntensity);

struct Exact {
  double mean = 0, variance = 0;
};
// Of the mean of N iterations, relative to L.
Exact exact(std::size_t iterations, double alpha) {
  double squared_radius = kFirstRadius * kFirstRadius, mean = 0, variance = 0;
  for (std::size_t i = 0; i < iterations; ++i) {
    if (i > 0) squared_radius *= (static_cast<double>(i) + alpha) / (static_cast<double>(i) + 1);
    const double p = (1 - 1 / std::sqrt(1 + squared_radius)) / 2;
    mean += 4 * p / squared_radius;
    variance += 16 / (squared_radius * squared_radius) * p * (1 - p) / kPhotons;
  }
  const auto n = static_cast<double>(iterations);
  return {mean / n, variance / (n * n)};
}

// [count of doublings][replicate]: the mean of 2^k iterations, relative to L.
std::vector<std::vector<double>> measure(const TestScene& scene, std::size_t doublings,
                                         std::size_t replicates) {
  const NamedState state = pilot_state(scene);
  const double limit = kIntensity * kReflectance / std::numbers::pi;
  std::vector<std::vector<double>> means(doublings + 1, std::vector<double>(replicates));
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t replicate = next++; replicate < replicates; replicate = next++) {
      const auto part = [&](std::uint32_t half, std::uint64_t begin, std::uint64_t end) {
        const auto count = static_cast<double>(end - begin);
        return count * render_layers(scene, state, 1000 + replicate, half, begin, end - begin)[0][0] / limit;
      };
      // Iteration i of a job has index i / 2 of half i % 2.
      double sum = part(0, 0, 1);
      means[0][replicate] = sum;
      sum += part(1, 0, 1);
      means[1][replicate] = sum / 2;
      for (std::size_t k = 2; k <= doublings; ++k) {
        const std::uint64_t begin = std::uint64_t{1} << (k - 2);
        for (const std::uint32_t half : {0U, 1U}) sum += part(half, begin, 2 * begin);
        means[k][replicate] = sum / std::ldexp(1.0, static_cast<int>(k));
      }
    }
  };
  // The probe's one replicate is the first, whichever thread would be the first.
  std::vector<std::jthread> threads;
  for (int i = 0; i < (proofs::probing() ? 1 : 2); ++i) threads.emplace_back(work);
  threads.clear();
  return means;
}

class Progressive : public testing::TestWithParam<const char*> {};

// Claim: mean and variance of the mean of N iterations are those of the stated radii, for N = 1, 2, 4 ...,
// and so both fall at the rates of the theory.
TEST_P(Progressive, BiasAndVarianceFallAsStated) {
  ASSERT_TRUE(has_integrator("ppm"));
  const double alpha = std::stod(GetParam());
  const std::size_t doublings = long_form() ? 12 : 7, replicates = long_form() ? 2000 : 600;
  TestScene scene = scene_from_xml(kScene, 1, 1);
  scene.settings.sampler = "independent";
  scene = with_integrator(scene, "ppm",
                          {{"alpha", GetParam()},
                           {"radius", fmt::format("{:.12g}", kFirstRadius / (kFloor * std::numbers::sqrt2))},
                           {"light_paths", std::to_string(kPhotons)}});
  const auto measured = measure(scene, doublings, replicates);

  const auto count = static_cast<double>(replicates);
  const double most = student_quantile(kAlarm / 2, count - 1);
  // Of a mean of few photons a little wider than for normal values: the kurtosis of a binomial of mean 3.
  const double low = chi_squared_quantile(1 - kAlarm / 2, count - 1) / (count - 1) / 1.15;
  const double high = 1.15 * chi_squared_quantile(kAlarm / 2, count - 1) / (count - 1);
  double first_bias = 0, first_variance = 0, last_bias = 0, last_variance = 0;
  for (std::size_t k = 0; k <= doublings; ++k) {
    const Moments found = moments_of(measured[k]);
    const double mean = found.mean(), variance = found.variance();
    const Exact right = exact(std::size_t{1} << k, alpha);
    const double error = std::sqrt(right.variance / count);
    std::printf(
        "alpha %s, N = %4zu: bias %+.4f (exact %+.4f, standard error %.4f), variance %.5f (exact %.5f)\n",
        GetParam(), std::size_t{1} << k, mean - 1, right.mean - 1, error, variance, right.variance);
    EXPECT_LT(std::fabs(mean - right.mean), most * error) << "N = " << (1 << k);
    EXPECT_GT(variance, low * right.variance) << "N = " << (1 << k);
    EXPECT_LT(variance, high * right.variance) << "N = " << (1 << k);
    if (k == doublings / 2) {
      first_bias = mean - 1;
      first_variance = variance;
    }
    last_bias = mean - 1;
    last_variance = variance;
  }
  const double doubled = static_cast<double>(doublings - doublings / 2) * std::numbers::ln2;
  std::printf(
      "alpha %s: over the last %zu doublings bias falls as N^%.3f (theory %.3f), variance as N^%.3f "
      "(theory %.3f)\n",
      GetParam(), doublings - doublings / 2, std::log(last_bias / first_bias) / doubled, alpha - 1,
      std::log(last_variance / first_variance) / doubled, -alpha);
  if (alpha == 1) return;  // the bias does not fall

  // Claim: the limit of infinitely many iterations follows from two of the means: what the closed form says
  // is left is left, and that is little of the bias there was.
  const std::size_t n = std::size_t{1} << doublings;
  const Extrapolation by = over_iterations(static_cast<double>(n / 4), static_cast<double>(n), alpha);
  const Moments limit = extrapolate(measured[doublings - 2], measured[doublings], by);
  const Exact coarse = exact(n / 4, alpha), fine = exact(n, alpha);
  const double left = by.fine * fine.mean + by.coarse * coarse.mean;
  std::printf("alpha %s: extrapolated to %+.4f (exact %+.4f, standard error %.4f)\n", GetParam(),
              limit.mean() - 1, left - 1, limit.error());
  EXPECT_GT(student_two_sided(t_statistic(limit.mean() - left, limit.error()), limit.freedom()), kAlarm);
  EXPECT_LT(std::fabs(left - 1), 0.25 * std::fabs(fine.mean - 1));
}

// Claim: the closed form itself has the rates of the theory.
TEST(ProgressiveTheory, ClosedFormHasTheRates) {
  for (const double alpha : {0.5, 2.0 / 3, 0.75}) {
    const Exact a = exact(1 << 16, alpha), b = exact(1 << 20, alpha);
    EXPECT_NEAR(std::log((b.mean - 1) / (a.mean - 1)) / std::log(16.0), alpha - 1, 0.01);
    EXPECT_NEAR(std::log(b.variance / a.variance) / std::log(16.0), -alpha, 0.01);
  }
}

INSTANTIATE_TEST_SUITE_P(, Progressive, testing::Values("0.5", "0.66666666667", "0.75", "1"),
                         [](const auto& one) {
                           const std::string alpha = one.param;
                           return "Alpha" + (alpha == "1" ? alpha : alpha.substr(2, 2));
                         });

}  // namespace
}  // namespace candela::statistical
