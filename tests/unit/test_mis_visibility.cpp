// The statistics of trained light selection: where they lie, the weights that follow, and the rule that
// decides them, on planted counts.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <set>
#include <tuple>

#include "common/stages/decision.h"
#include "common/stages/light_visibility.h"
#include "tests/replay.h"

namespace candela {
namespace {

using film::Int128;
using film::MergedAccumulator;

EpochPlan trained_epochs(const light_visibility::Layout& layout) {
  return {4,
          1,
          1,
          std::string(light_visibility::kRule),
          {{"entries", std::to_string(layout.entries())}, {"lights", std::to_string(layout.lights)}}};
}

// Claim: the table has a place of its own for each entry of the grid, whatever the film's size, and a film
// too small for finer grids has one cell.
TEST(LightVisibility, EntriesHavePlacesOfTheirOwn) {
  for (const auto& [width, height, lights] :
       {std::tuple{1U, 1U, 2U}, {16U, 16U, 64U}, {17U, 5U, 3U}, {640U, 480U, 64U}}) {
    const light_visibility::Layout layout = light_visibility::layout(width, height, lights);
    ASSERT_GT(layout.side, 0U);
    std::set<std::pair<std::uint32_t, std::uint32_t>> seen;
    const film::Layout grid = film::grid_of(light_visibility::spec(layout), width, height);
    for (std::uint32_t e = 0; e < layout.entries(); ++e) {
      const auto at = film::place_of_entry(e);
      EXPECT_LT(at.x, grid.width);
      EXPECT_LT(at.y, grid.height);
      EXPECT_TRUE(seen.emplace(at.x, at.y).second);
    }
    EXPECT_TRUE(film::validate(std::vector{light_visibility::spec(layout)}, width, height).ok());
  }
  EXPECT_EQ(light_visibility::layout(1, 1, 17).side, 1U);
  EXPECT_EQ(light_visibility::layout(1920, 1080, 64).side, light_visibility::kMaxSide);
}

// Claim: a weight is 255 times the root of the estimated visibility, rounded down, and no light is left out.
TEST(LightVisibility, WeightsAreRootsOfTheVisibility) {
  EXPECT_EQ(light_visibility::weight(0, 0), 255);
  EXPECT_EQ(light_visibility::weight(1000, 1000), 255);
  EXPECT_EQ(light_visibility::weight(99, 24), 127);  // a quarter
  EXPECT_EQ(light_visibility::weight(3, 0), 127);
  EXPECT_EQ(light_visibility::weight(std::uint64_t{1} << 40, 0), light_visibility::kMinWeight);
  for (std::uint64_t tested = 0; tested < 60; ++tested)
    for (std::uint64_t seen = 0; seen <= tested; ++seen) {
      const double exact =
          255 * std::sqrt((static_cast<double>(seen) + 1) / (static_cast<double>(tested) + 1));
      EXPECT_NEAR(light_visibility::weight(tested, seen), std::max(exact - 0.5, 16.0), 0.5 + 1e-9);
    }
}

// Claim: the state follows from the sums of all epochs that are folded, lag epochs late, and a rule that is
// given another job's accumulators says so.
TEST(LightVisibility, TheRuleAddsEpochsUp) {
  constexpr std::uint32_t kWidth = 6, kHeight = 4;
  const light_visibility::Layout layout = light_visibility::layout(kWidth, kHeight, 3);
  const std::vector specs = {light_visibility::spec(layout)};
  std::vector<MergedAccumulator> sums;
  const std::uint32_t entry = layout.entries() - 1;
  const auto at = film::place_of_entry(entry);
  for (const auto& [tested, seen] : {std::pair{3, 0}, {5, 1}, {90, 23}}) {
    MergedAccumulator& epoch = sums.emplace_back(kWidth, kHeight, specs[0]);
    epoch.set_pixel(at.x, at.y, std::array<Int128, 2>{tested, seen});
  }
  const auto of_epoch = [&](std::string_view, std::uint64_t epoch) { return &sums[epoch]; };
  const auto done = replay(trained_epochs(layout), specs, 5, kWidth, kHeight, of_epoch);
  ASSERT_TRUE(done.ok()) << done.error().to_string();
  const int expected[] = {255, 255, 127, light_visibility::weight(8, 1), light_visibility::weight(98, 24)};
  for (std::size_t e = 0; e < 5; ++e) {
    std::string state(layout.entries(), '\xff');
    state.back() = static_cast<char>(expected[e]);
    EXPECT_EQ(done->states[e], state) << e;
  }
  std::vector wrong = specs;
  wrong[0].name = "another";
  EXPECT_FALSE(replay(trained_epochs(layout), wrong, 1, kWidth, kHeight, of_epoch).ok());
  wrong = specs;
  wrong[0].entries -= layout.lights;
  EXPECT_FALSE(replay(trained_epochs(layout), wrong, 1, kWidth, kHeight, of_epoch).ok());
}

// Claim: where an untrained epoch of enough tests saw nearly all lights, or each of a cell as rarely, all
// later states are empty, whatever later epochs count; hidden lights, or too few tests, keep the choice
// trained.
TEST(LightVisibility, LittleToGainEndsTheTraining) {
  constexpr std::uint32_t kWidth = 8, kHeight = 4;
  const light_visibility::Layout layout = light_visibility::layout(kWidth, kHeight, 2);
  ASSERT_GE(layout.entries(), 4U);
  const std::vector specs = {light_visibility::spec(layout)};
  struct Case {
    int tested, seen_of_first, seen_of_second;  // of each light in each cell
    bool trained;
  };
  const int cells = static_cast<int>(layout.entries() / 2);
  for (const Case& c : {Case{4000, 4000, 4000, false}, Case{4000, 2000, 2000, false},
                        Case{4000, 4000, 3700, false}, Case{4000, 4000, 0, true},
                        Case{4000, 4000, 1000, true}, Case{2000 / cells, 2000 / cells, 2000 / cells, true}}) {
    std::vector<MergedAccumulator> sums;
    for (const bool first : {true, false}) {
      MergedAccumulator& epoch = sums.emplace_back(kWidth, kHeight, specs[0]);
      for (std::uint32_t e = 0; e < layout.entries(); ++e) {
        const auto at = film::place_of_entry(e);
        const int seen = !first ? 0 : e % 2 == 0 ? c.seen_of_first : c.seen_of_second;
        epoch.set_pixel(at.x, at.y, std::array<Int128, 2>{c.tested, seen});
      }
    }
    const auto done = replay(trained_epochs(layout), specs, 4, kWidth, kHeight,
                             [&](std::string_view, std::uint64_t epoch) { return &sums[epoch]; });
    ASSERT_TRUE(done.ok()) << done.error().to_string();
    for (std::size_t e = 0; e < 4; ++e)
      EXPECT_EQ(done->states[e].size(), e < 2 || c.trained ? layout.entries() : 0)
          << c.tested << " " << c.seen_of_second << " " << e;
  }
}

}  // namespace
}  // namespace candela
