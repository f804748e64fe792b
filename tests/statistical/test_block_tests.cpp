// The block test tested: how often it alarms where there is nothing, and whether it sees what it says it can.
// Counts are compared with binomial bounds that correct code exceeds with probability 1e-4 each; there are
// fewer than ten: the file alarms falsely with probability below 1e-3.
#include <gtest/gtest.h>

#include <array>
#include <boost/math/distributions/binomial.hpp>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <cstdio>

#include "common/rng/stream.h"
#include "tests/proofs/proofs.h"
#include "tests/statistical/harness.h"

namespace candela::statistical {
namespace {

// Films decide these tests: proofs.h.
const proofs::FilmsDecide kFilms({"BlockTests.PathAgainstPath",
                                  "BlockTests.SeesThreePercentMoreReflectance"});

constexpr double kAlpha = 1e-4;

// The largest count among n trials of probability p that is not an alarm.
double upper_bound(std::size_t n, double p) {
  return boost::math::quantile(
      boost::math::complement(boost::math::binomial(static_cast<double>(n), p), kAlpha));
}
double lower_bound(std::size_t n, double p) {
  return boost::math::quantile(boost::math::binomial(static_cast<double>(n), p), kAlpha);
}

double normal(rng::Stream& stream) {
  const double u = (static_cast<double>(stream.next_float()) + 0x1p-26) / (1 + 0x1p-25);
  return boost::math::quantile(boost::math::normal(), u);
}

const Regions kRegions(32, 32, 8);  // 16 blocks

// Batches of a made-up image: every value is 1 + noise, with noise shared by all values (as light paths do)
// and noise of its own. `skew`: lognormal noise. `bias`: of one value.
Estimator made_up(std::uint64_t seed, double sigma, double skew, double bias, std::size_t batches = 16) {
  return {"made up", [=](std::uint64_t stage, double effort) {
            rng::Stream stream(seed * 977 + stage);
            Rows rows(batches, std::vector<double>(kRegions.values()));
            const double s = sigma / std::sqrt(effort);
            for (auto& row : rows) {
              const double common = normal(stream);
              for (double& value : row) {
                double noise = (common + normal(stream)) / std::sqrt(2.0);
                if (skew > 0) noise = (std::exp(skew * noise - skew * skew / 2) - 1) / skew;
                value = 1 + s * noise;
              }
              row[7] += bias;
            }
            return rows;
          }};
}

// Claim: with nothing to find, stage one suspects in at most alpha_suspect of the cases, for normal batches
// that are correlated over the image, and for skewed ones (lognormal of skewness 1.5, one estimator only) in
// at most five times that: what stage two is for.
TEST(BlockTests, FalseAlarms) {
  constexpr std::size_t kTrials = 1500;
  BlockTest test;
  test.alpha_suspect = 0.05;
  for (const double skew : {0.0, 0.45}) {
    std::size_t alarms = 0, confirmed = 0, tested = 0;
    for (std::size_t trial = 0; trial < kTrials; ++trial) {
      const Verdict v =
          compare(made_up(2 * trial + 1, 0.1, skew, 0), made_up(2 * trial + 2, 0.1, 0, 0), kRegions, test);
      alarms += v.suspects > 0;
      confirmed += !v.agree;
      tested += v.tested;
    }
    std::printf("skew %.2f: %zu of %zu suspect, %zu confirmed, %.3f of the values tested\n", skew, alarms,
                kTrials, confirmed,
                static_cast<double>(tested) / static_cast<double>(kTrials * kRegions.values()));
    EXPECT_LE(static_cast<double>(alarms), upper_bound(kTrials, skew == 0 ? 0.05 : 0.25));
    EXPECT_LE(static_cast<double>(confirmed), upper_bound(kTrials, 1e-3));
  }
}

// Claim: the standard error of the ratio to a reference is that of what all blocks of a batch may share
// (chains' b, light paths), of noise of their own, and of the reference's. Trials beyond t's 1 % points of 15
// degrees of freedom are as many as that says, or fewer for the reference's share (whose deviations have no
// freedom to lose).
TEST(BlockTests, TheRatioKnowsItsError) {
  constexpr std::size_t kTrials = 600, kBatches = 16, kBlocks = 16;
  constexpr std::uint32_t kSide = 4;  // blocks of one pixel
  for (const auto& [common, own, reference_error] :
       {std::array{0.01, 0.001, 0.0}, {0.0, 0.01, 0.0}, {0.01, 0.01, 0.01}, {0.0, 0.001, 0.01}}) {
    std::size_t beyond = 0;
    for (std::size_t trial = 0; trial < kTrials; ++trial) {
      rng::Stream stream(rng::key(31, trial));
      const auto grey = [](std::vector<float>& image, std::size_t pixel, double value) {
        for (std::size_t c = 0; c < 3; ++c) image[3 * pixel + c] = static_cast<float>(value);
      };
      std::vector<float> reference(3 * kBlocks), deviation(3 * kBlocks, static_cast<float>(reference_error));
      for (std::size_t i = 0; i < kBlocks; ++i) grey(reference, i, 1 + reference_error * normal(stream));
      std::vector<std::vector<float>> batches(kBatches, std::vector<float>(3 * kBlocks));
      for (auto& batch : batches) {
        const double shared = common * normal(stream);
        for (std::size_t i = 0; i < kBlocks; ++i) grey(batch, i, 1 + shared + own * normal(stream));
      }
      const auto result = block_test(batches, reference, deviation, kSide, kSide, {1, 0.1, 0, {}});
      ASSERT_EQ(result.tested, 3 * kBlocks);
      beyond += std::abs(result.ratio - 1) > 2.947 * result.ratio_stderr ? 1 : 0;
    }
    std::printf("common %.3f, own %.3f, reference %.3f: %zu of %zu beyond the 1 %% points\n", common, own,
                reference_error, beyond, kTrials);
    EXPECT_LE(static_cast<double>(beyond), upper_bound(kTrials, 0.012));  // weights are estimated, too
  }
}

// Claim: of blocks where batches are known to miss light, only what is too bright counts, and the ratio
// leaves them out; of the others both.
TEST(BlockTests, OnlyWhatIsTooBright) {
  constexpr std::uint32_t kExtent = 16, kBlock = 8;
  const std::vector<float> reference(std::size_t{kExtent} * kExtent * 3, 1.0f);
  const auto result = [&](float left_top, bool only_brighter) {
    std::vector<std::vector<float>> batches;
    for (std::uint64_t k = 0; k < 16; ++k) {
      rng::Stream stream(k);
      batches.push_back(reference);
      for (std::size_t i = 0; i < reference.size(); ++i) {
        const std::size_t pixel = i / 3;
        const bool in_block = pixel % kExtent < kBlock && pixel / kExtent < kBlock;
        batches.back()[i] = (in_block ? left_top : 1.0f) * (0.95f + 0.1f * stream.next_float());
      }
    }
    BlockTestOptions options;
    options.block = kBlock;
    if (only_brighter) options.only_brighter = {{0, 0}};
    return block_test(batches, reference, {}, kExtent, kExtent, options);
  };
  EXPECT_LT(result(0.9f, false).adjusted_p, 1e-6);
  EXPECT_GT(result(0.9f, true).adjusted_p, 1e-3);
  EXPECT_NEAR(result(0.9f, true).ratio, 1, 0.005);
  EXPECT_LT(result(1.1f, true).adjusted_p, 1e-6);
}

// Claim: a bias as large as `detectable` says is found with probability 0.9, and one of a third of it, or one
// that the margin allows, hardly ever.
TEST(BlockTests, PowerIsAsStated) {
  constexpr std::size_t kTrials = 400;
  for (const double margin : {0.0, 0.05}) {
    BlockTest test;
    test.margin = margin;
    Welch typical;
    typical.mean_b = 1;
    typical.deviation = 0.1 * std::sqrt(2.0 / 16);
    typical.freedom = 30;
    const double bias = detectable(typical, kRegions.values(), test);
    std::size_t found = 0, third = 0;
    for (std::size_t trial = 0; trial < kTrials; ++trial) {
      const auto reference = made_up(2 * trial + 2, 0.1, 0, 0);
      found += !compare(made_up(2 * trial + 1, 0.1, 0, bias), reference, kRegions, test).agree;
      third +=
          !compare(made_up(2 * trial + 1, 0.1, 0, margin + (bias - margin) / 3), reference, kRegions, test)
               .agree;
    }
    std::printf("margin %.2f: bias %.4f found in %zu of %zu, a third of it in %zu\n", margin, bias, found,
                kTrials, third);
    EXPECT_GE(static_cast<double>(found), lower_bound(kTrials, 0.88));
    EXPECT_LE(static_cast<double>(third), upper_bound(kTrials, 0.1));
  }
}

// Claim: the nightly form's planning. Of a small run of either estimator effort_for makes the efforts by
// which a bias of `target` in one block is found with probability 0.9, and does not ask for far too much.
TEST(BlockTests, EffortIsEnoughForTheTarget) {
  constexpr std::size_t kTrials = 400, kBatches = 32;
  constexpr double kTarget = 0.005, kShare = 0.8;
  BlockTest test;
  test.margin = 0.001;
  std::size_t found = 0;
  double detectables = 0;
  for (std::size_t trial = 0; trial < kTrials; ++trial) {
    const auto effort = [&](const Estimator& small, double share) {
      return effort_for(small.rows(0, 1), kRegions, kTarget, kBatches, share, test);
    };
    test.effort = effort(made_up(4 * trial + 1, 0.1, 0, 0, 12), kShare);
    test.effort_reference = effort(made_up(4 * trial + 2, 0.02, 0, 0, 12), 1 - kShare);
    const Verdict verdict = compare(made_up(4 * trial + 3, 0.1, 0, kTarget, kBatches),
                                    made_up(4 * trial + 4, 0.02, 0, 0, kBatches), kRegions, test);
    found += !verdict.agree;
    detectables += verdict.detectable_median / kTrials;
  }
  std::printf("a bias of %.3f found in %zu of %zu; detectable in the median block %.4f\n", kTarget, found,
              kTrials, detectables);
  EXPECT_GE(static_cast<double>(found), lower_bound(kTrials, 0.9));
  EXPECT_GT(detectables, 0.6 * kTarget);
}

const char* const kScene =
    R"(<scene version="3.0.0"><integrator type="path"><integer name="max_depth" value="5"/></integrator>
    <sensor type="perspective"><float name="fov" value="45"/>
      <transform name="to_world"><lookat origin="0, 4, 9" target="0, 1, 0" up="0, 1, 0"/></transform></sensor>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="8"/></transform>
      <bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="0.6, 0.5, 0.4"/></bsdf></bsdf></shape>
    <shape type="cube"><transform name="to_world"><translate x="-1.5" y="1"/></transform>
      <bsdf type="roughconductor"><float name="alpha" value="0.2"/></bsdf></shape>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/><translate y="5"/></transform>
      <emitter type="area"><rgb name="radiance" value="9, 8, 7"/></emitter></shape>
    <emitter type="constant"><rgb name="radiance" value="0.3, 0.4, 0.5"/></emitter></scene>)";

// Claim: on real images `path` against `path` of other seeds is suspected no more often than stated, and
// single values' p are uniform in the tails.
TEST(BlockTests, PathAgainstPath) {
  const std::size_t trials = long_form() ? 1000 : 100;
  constexpr std::size_t kBatches = 16;
  TestScene scene = scene_from_xml(kScene, 32, 32);
  BatchPlan plan;
  plan.batches = kBatches * 2 * trials;
  plan.iterations = 2;
  const Rows all = render_rows({{1.0, scene}}, plan, kRegions, 1, 1);
  const auto slice = [&](std::size_t k) {
    return Estimator{"path", [&, k](std::uint64_t, double) {
                       return Rows(all.begin() + static_cast<std::ptrdiff_t>(k * kBatches),
                                   all.begin() + static_cast<std::ptrdiff_t>((k + 1) * kBatches));
                     }};
  };
  BlockTest test;
  test.alpha_suspect = 0.05;
  std::size_t alarms = 0, skewed = 0;
  for (std::size_t trial = 0; trial < trials; ++trial) {
    const Verdict v = compare(slice(2 * trial), slice(2 * trial + 1), kRegions, test);
    alarms += v.suspects > 0;
    skewed += v.values - v.tested;
  }
  std::printf("path against path: %zu of %zu suspect at 0.05, %zu values too skewed\n", alarms, trials,
              skewed);
  EXPECT_LE(static_cast<double>(alarms), upper_bound(trials, 0.05));
  EXPECT_LE(static_cast<double>(skewed), 0.02 * static_cast<double>(trials * kRegions.values()));
}

// Claim: the whole chain sees a wrong picture: a floor 3 % brighter in one channel.
TEST(BlockTests, SeesThreePercentMoreReflectance) {
  std::string brighter = kScene;
  brighter.replace(brighter.find("0.6, 0.5, 0.4"), 13, "0.6, .515, 0.4");
  BatchPlan plan;
  plan.iterations = 16;
  const auto right = cached(make_estimator("path", {{1.0, scene_from_xml(kScene, 32, 32)}}, plan, kRegions));
  plan.seed = 5000;
  const Verdict same = compare(
      make_estimator("path", {{1.0, scene_from_xml(kScene, 32, 32)}}, plan, kRegions), right, kRegions, {});
  const Verdict wrong =
      compare(make_estimator("brighter", {{1.0, scene_from_xml(brighter, 32, 32)}}, plan, kRegions), right,
              kRegions, {});
  std::printf("%s\n%s\n", same.report.c_str(), wrong.report.c_str());
  EXPECT_TRUE(same.agree) << same.report;
  EXPECT_FALSE(wrong.agree);
}

}  // namespace
}  // namespace candela::statistical
