// Phase functions: their values against the formulas, their samples against their values. A comparison is a
// two-sided test at 5 standard errors or a chi-squared test at p = 1e-6; there are fewer than 20 of them.
// Seeds are fixed.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/statistical/moments.h"
#include "tests/unit/chi_squared.h"
#include "tests/unit/expected_mean.h"
#include "tests/unit/scene_fixture.h"
#include "worker/scene/media/medium.h"

namespace candela::scene {
namespace {

using test::build_scene;
using test::chi_squared_p;
using test::expect_mean;

constexpr double kMinPhaseP = 1e-6;

Phase phase_of(double g) {
  return g == 0 ? Phase() : Phase::henyey_greenstein(static_cast<float>(g));
}

// Henyey and Greenstein's formula as it is written, in long double.
double literal_hg(double g, double versed) {  // versed = 1 - cos
  const long double d = 1 + static_cast<long double>(g) * g - 2 * static_cast<long double>(g) * (1 - versed);
  return static_cast<double>((1 - static_cast<long double>(g) * g) /
                             (4 * std::numbers::pi_v<long double> * d * std::sqrt(d)));
}

// Probability of a larger 1 - cos.
double hg_beyond(double g, double versed) {
  if (g == 0) return 1 - versed / 2;
  return (1 - g * g) / (2 * g) * (1 / std::sqrt((1 - g) * (1 - g) + 2 * g * versed) - 1 / (1 + g));
}

// Claim: phase functions integrate to one, are what Henyey and Greenstein wrote, and are the same from both
// ends; g > 0 scatters forward.
TEST(ScenePhase, FunctionsAreNormalised) {
  for (const double g : {-0.99, -0.5, 0.0, 1e-4, 0.3, 0.9, 0.999}) {
    const Phase phase = phase_of(g);
    const Vec3 wo = normalize(Vec3{0.3f, -0.8f, 0.2f});
    const Frame frame = make_frame(-wo);
    const auto direction = [&](double versed) {
      const double sine = std::sqrt(versed * (2 - versed));
      return frame.to_world({static_cast<float>(sine), 0, static_cast<float>(1 - versed)});
    };
    double integral = 0;
    constexpr int kSteps = 20000;
    // versed = 2 x^4 resolves the forward peak; backward ones are the mirror image.
    for (int i = 0; i < kSteps; ++i) {
      const double x = (i + 0.5) / kSteps, versed = 2 * x * x * x * x, width = 8 * x * x * x / kSteps;
      const Vec3 wi = g >= 0 ? direction(versed) : -direction(versed);
      integral += 2 * std::numbers::pi * static_cast<double>(phase.eval(wo, wi)) * width;
      ASSERT_EQ(phase.eval(wo, wi), phase.eval(wi, wo));
    }
    EXPECT_NEAR(integral, 1, 2e-3) << g;
    for (const double versed : {0.01, 0.3, 1.0, 1.9})
      EXPECT_NEAR(static_cast<double>(phase.eval(wo, direction(versed))) / literal_hg(g, versed), 1, 1e-4)
          << g;
    if (g > 0) {
      EXPECT_GT(phase.eval(wo, -wo), phase.eval(wo, wo));
    }
  }
}

// Claim: sample() draws by eval(), whose mean cosine is g, and returns the density it drew by.
TEST(ScenePhase, FunctionsSampleTheirValue) {
  for (const double g : {-0.95, -0.5, 0.0, 1e-4, 0.3, 0.9, 0.999}) {
    const Phase phase = phase_of(g);
    rng::Stream stream(rng::key(7, static_cast<std::uint64_t>(g * 1000 + 2000)));
    const Vec3 wo = test::uniform_direction(stream);
    const Frame frame = make_frame(-wo);
    constexpr int kCosines = 24, kAngles = 8, kSamples = 60000;
    std::vector<double> observed(kCosines * kAngles, 0.0),
        expected(kCosines * kAngles, 1.0 * kSamples / kCosines / kAngles);
    statistical::Moments cosine;
    for (int i = 0; i < kSamples; ++i) {
      const float u = stream.next_float();
      Vec3 wi;
      const float pdf = phase.sample(wo, {u, stream.next_float()}, wi);
      ASSERT_NEAR(length(wi), 1, 1e-5);
      ASSERT_NEAR(pdf / phase.pdf_solid_angle(wo, wi), 1, 2e-2);
      const Vec3 local = frame.to_local(wi);
      cosine.add(static_cast<double>(local.z));
      const double q =
          std::clamp(hg_beyond(g, 0.5 * static_cast<double>(length_squared(wi + wo))), 0.0, 1 - 1e-9);
      const double angle = std::atan2(local.y, local.x) / (2 * std::numbers::pi) + 0.5;
      ++observed[static_cast<std::size_t>(q * kCosines) * kAngles +
                 std::min<std::size_t>(static_cast<std::size_t>(angle * kAngles), kAngles - 1)];
    }
    EXPECT_GT(chi_squared_p(observed, expected), kMinPhaseP) << g;
    expect_mean(cosine, g, "mean cosine", 1e-4, 0);
  }
}

// Claim: Rayleigh's phase function is 3 (1 + cos^2) / 16 pi, from both ends, and sampled by it.
TEST(ScenePhase, RayleighSamplesItsValue) {
  const auto scene = build_scene(
      "<shape type=\"cube\"><medium name=\"interior\" type=\"homogeneous\"><phase "
      "type=\"rayleigh\"/></medium></shape>");
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  const Phase& phase = (*scene)->medium(0).phase();
  rng::Stream stream(17);
  constexpr int kBins = 32, kSamples = 60000;
  std::vector<double> observed(kBins, 0.0);
  for (int i = 0; i < kSamples; ++i) {
    const Vec3 wo = test::uniform_direction(stream);
    const float u = stream.next_float();
    Vec3 wi;
    const float pdf = phase.sample(wo, {u, stream.next_float()}, wi);
    const double c = -static_cast<double>(dot(wo, wi));
    ASSERT_NEAR(static_cast<double>(pdf), 3 * (1 + c * c) / (16 * std::numbers::pi), 1e-6);
    ASSERT_NEAR(phase.eval(wo, wi), pdf, 1e-6);
    ASSERT_EQ(phase.eval(wo, wi), phase.eval(wi, wo));
    const double below = (c * c * c + 3 * c + 4) / 8;
    ++observed[static_cast<std::size_t>(std::clamp(below, 0.0, 1 - 1e-9) * kBins)];
  }
  EXPECT_GT(chi_squared_p(observed, std::vector<double>(kBins, 1.0 * kSamples / kBins)), kMinPhaseP);
}

// Claim: a blend of phase functions, blends among them, has the weighted sum of their values, is sampled by
// it, and its mean cosine is the weighted mean.
TEST(ScenePhase, BlendsSampleTheirValue) {
  const auto scene = build_scene(
      "<shape type='cube'><medium name='interior' type='homogeneous'><phase type='blendphase'>"
      "<float name='weight' value='0.4'/><phase type='hg'><float name='g' value='0.6'/></phase>"
      "<phase type='blendphase'><float name='weight' value='0.25'/><phase type='rayleigh'/>"
      "<phase type='hg'><float name='g' value='-0.5'/></phase></phase></phase></medium></shape>");
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  const Phase& phase = (*scene)->medium(0).phase();
  const Phase parts[] = {phase_of(0.6), Phase::rayleigh(), phase_of(-0.5)};
  const float weights[] = {0.6f, 0.3f, 0.1f};
  rng::Stream stream(19);
  constexpr int kBins = 32, kSamples = 60000;
  std::vector<double> observed(kBins, 0.0), expected(kBins, 0.0);
  const Vec3 wo = test::uniform_direction(stream);
  const Frame frame = make_frame(-wo);
  const auto value = [&](Vec3 wi) {
    float sum = 0;
    for (std::size_t i = 0; i < 3; ++i) sum += weights[i] * parts[i].eval(wo, wi);
    return sum;
  };
  constexpr int kFine = 64;
  for (int i = 0; i < kBins * kFine; ++i) {
    const double c = (i + 0.5) * 2 / (kBins * kFine) - 1;
    const Vec3 wi = frame.to_world({static_cast<float>(std::sqrt(1 - c * c)), 0, static_cast<float>(c)});
    expected[static_cast<std::size_t>(i / kFine)] +=
        static_cast<double>(value(wi)) * 2 * std::numbers::pi * 2 / (kBins * kFine) * kSamples;
  }
  statistical::Moments cosine;
  for (int i = 0; i < kSamples; ++i) {
    const float u = stream.next_float();
    Vec3 wi;
    const float pdf = phase.sample(wo, {u, stream.next_float()}, wi);
    ASSERT_EQ(pdf, phase.eval(wo, wi));
    ASSERT_NEAR(pdf / value(wi), 1, 1e-5);
    ASSERT_EQ(phase.eval(wo, wi), phase.eval(wi, wo));
    const double c = -static_cast<double>(dot(wo, wi));
    cosine.add(c);
    ++observed[static_cast<std::size_t>(std::clamp(0.5 * c + 0.5, 0.0, 1 - 1e-9) * kBins)];
  }
  EXPECT_GT(chi_squared_p(observed, expected), kMinPhaseP);
  EXPECT_NEAR(phase.mean_cosine(), 0.6f * 0.6f - 0.1f * 0.5f, 1e-6f);
  expect_mean(cosine, 0.31, "mean cosine", 1e-4, 0);
}

}  // namespace
}  // namespace candela::scene
