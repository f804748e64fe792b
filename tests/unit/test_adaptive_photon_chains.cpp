// The step sizes of mcppm: counts of epochs, the rule that decides from them, and what it tells.
#include <gtest/gtest.h>

#include <cmath>

#include "common/stages/decision.h"
#include "common/stages/photon_chains.h"
#include "tests/replay.h"

namespace candela {
namespace {

using photon_chains::Counts;

EpochPlan chain_epochs(const std::string& step = "0.015625") {
  return {4, 1, 1, std::string(photon_chains::kRule), {{"step", step}}};
}

// The sums of an epoch of `iterations` such iterations.
film::MergedAccumulator sums_of(const Counts& counts, std::uint64_t iterations, std::uint32_t width,
                                std::uint32_t height) {
  const film::AccumulatorSpec spec = photon_chains::spec(width, height);
  film::UnitAccumulator unit(width, height, spec);
  film::SampleCounts sample_counts;
  for (std::uint64_t i = 0; i < iterations; ++i) photon_chains::add(counts, i, unit, width, sample_counts);
  film::MergedAccumulator merged(width, height, spec);
  std::vector<film::Int128> pixel(spec.channels);
  for (std::uint32_t y = 0; y < height; ++y)
    for (std::uint32_t x = 0; x < width; ++x) {
      for (std::uint32_t c = 0; c < spec.channels; ++c)
        pixel[c] = unit.sums()[(std::size_t{y} * width + x) * spec.channels + c];
      merged.set_pixel(x, y, pixel);
    }
  return merged;
}

// Claim: counts of any film survive the accumulator exactly, each in a place of its own.
TEST(PhotonChains, CountsAreExactOnAnyFilm) {
  const Counts one{1, 1, 5'000'000'001, 123'456'789, 99'999'999'999, 7, 15'241'578'750};
  for (const auto& [width, height] : {std::pair{1U, 1U}, {2U, 2U}, {5U, 1U}, {1U, 6U}, {640U, 480U}}) {
    EXPECT_TRUE(film::validate(std::vector{photon_chains::spec(width, height)}, width, height).ok());
    const Counts three = photon_chains::read(sums_of(one, 3, width, height));
    EXPECT_EQ(three, (Counts{3, 3, 3 * one.light_paths, 3 * one.visible_paths, 3 * one.mutations, 21,
                             3 * one.visible_squares}));
  }
}

// Claim: a step moves by exp(4 (acceptance - 0.234)) and stays within its bounds.
TEST(PhotonChains, StepsFollowTheAcceptance) {
  for (const std::uint64_t accepted : {0ULL, 100ULL, 234ULL, 500ULL, 1000ULL})
    EXPECT_NEAR(photon_chains::next_step(0.01, accepted, 1000),
                0.01 * std::exp(4 * (static_cast<double>(accepted) / 1000 - 0.234)), 1e-15);
  EXPECT_EQ(photon_chains::next_step(0.4, 1000, 1000), photon_chains::kMaxStep);
  EXPECT_EQ(photon_chains::next_step(1.1e-4, 0, 1000), photon_chains::kMinStep);
  // Towards 0.23 from both ends, if the acceptance falls with the logarithm of the step.
  for (double step : {0.5, 1e-3}) {
    for (int e = 0; e < 40; ++e) {
      const double acceptance = std::clamp(0.234 - 0.2 * std::log(step / 0.043), 0.0, 1.0);
      step = photon_chains::next_step(step, static_cast<std::uint64_t>(acceptance * 1e9), 1'000'000'000);
    }
    EXPECT_NEAR(step, 0.043, 1e-4);
  }
}

// Claim: the step of an epoch follows from that of the epoch that is folded, lag epochs late; an epoch
// without mutations changes nothing; the report has the figures of all folded epochs.
TEST(PhotonChains, TheRuleDecidesFromWholeEpochs) {
  constexpr std::uint32_t kWidth = 4, kHeight = 3;
  const std::vector specs = {photon_chains::spec(kWidth, kHeight)};
  const std::vector epochs = {sums_of({1, 0, 100, 10, 100, 50, 100}, 4, kWidth, kHeight),
                              sums_of({1, 1, 100, 0, 0, 0}, 4, kWidth, kHeight),
                              sums_of({1, 0, 100, 6, 100, 10, 36}, 2, kWidth, kHeight)};
  const auto of_epoch = [&](std::string_view, std::uint64_t epoch) { return &epochs[epoch]; };
  const auto done = replay(chain_epochs(), specs, 5, kWidth, kHeight, of_epoch);
  ASSERT_TRUE(done.ok()) << done.error().to_string();
  const double first = 0.015625, after_0 = photon_chains::next_step(first, 200, 400),
               after_2 = photon_chains::next_step(after_0, 20, 200);
  const double expected[] = {first, first, after_0, after_0, after_2};
  for (std::size_t e = 0; e < 5; ++e) {
    const auto step = photon_chains::step_of(done->states[e]);
    ASSERT_TRUE(step.ok());
    EXPECT_EQ(*step, expected[e]) << e;
  }
  const auto rule = find_rule(photon_chains::kRule);
  ASSERT_TRUE(rule.ok());
  const auto report = rule->describe(chain_epochs(), 4, kWidth, kHeight, done->states[4], done->carry, false);
  ASSERT_TRUE(report.ok());
  // 4 iterations have 10 visible paths, 4 none, 2 have 6: the mean is 5.2.
  const double flicker = std::sqrt((472 - 10 * 5.2 * 5.2) / 9) / 5.2;
  const std::vector<std::pair<std::string, double>> figures = {{"step size", after_2},
                                                               {"acceptance", 220.0 / 600},
                                                               {"visible fraction", 52.0 / 1000},
                                                               {"black iterations", 4},
                                                               {"flicker of an iteration", flicker}};
  EXPECT_EQ(report->figures, figures);
}

// Claim: without the accumulator (the pilot decided against chains) the step stays and there is nothing to
// tell; accumulators of another job and steps out of bounds are refused; so are states that are no step.
TEST(PhotonChains, OthersAreRefused) {
  const auto none = [](std::string_view, std::uint64_t) -> const film::MergedAccumulator* { return nullptr; };
  const auto done = replay(chain_epochs("0.25"), {}, 6, 4, 3, none);
  ASSERT_TRUE(done.ok()) << done.error().to_string();
  for (const std::string& state : done->states) EXPECT_EQ(state, photon_chains::state_of(0.25));
  const auto rule = find_rule(photon_chains::kRule);
  ASSERT_TRUE(rule.ok());
  const auto report = rule->describe(chain_epochs("0.25"), 5, 4, 3, done->states.back(), done->carry, false);
  ASSERT_TRUE(report.ok());
  EXPECT_TRUE(report->figures.empty());
  std::vector wrong = {photon_chains::spec(4, 3)};
  wrong[0].name = "another";
  EXPECT_FALSE(replay(chain_epochs(), wrong, 1, 4, 3, none).ok());
  for (const char* step : {"0", "0.6", "nan", "a"})
    EXPECT_FALSE(replay(chain_epochs(step), {}, 1, 4, 3, none).ok()) << step;
  const std::string good = photon_chains::state_of(0.1);
  for (const std::string& bytes : {std::string(), good.substr(1), good + "x", photon_chains::state_of(0.51),
                                   photon_chains::state_of(0), photon_chains::state_of(std::nan(""))}) {
    const auto step = photon_chains::step_of(bytes);
    ASSERT_FALSE(step.ok());
    EXPECT_EQ(step.error().field, "states");
  }
}

}  // namespace
}  // namespace candela
