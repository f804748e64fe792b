// Borders of epochs.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "common/job/job.h"
#include "common/rng/stream.h"
#include "common/stages/epochs.h"

namespace candela {
namespace {

// Claim: epochs follow the recurrence, written out by hand for max(8, T/16) and for odd lengths.
TEST(Epochs, FollowTheRecurrence) {
  const Epochs epochs(8, 16);
  for (std::uint64_t e = 0; e <= 16; ++e) EXPECT_EQ(epochs.begin(e), 8 * e);
  EXPECT_EQ(epochs.begin(17), 136U);
  EXPECT_EQ(epochs.begin(18), 144U);  // 136 / 16 = 8
  EXPECT_EQ(epochs.begin(19), 154U);  // 144 / 16 = 9, rounded up to 10
  const Epochs odd(3, 1);
  const std::uint64_t expected[] = {0, 4, 8, 16, 32, 64};
  for (std::uint64_t e = 0; e < 6; ++e) EXPECT_EQ(odd.begin(e), expected[e]) << e;
}

// Claim: every iteration up to the limit is in exactly one epoch, all borders are even, and both halves have
// the same indices of an epoch.
TEST(Epochs, TileAllIterations) {
  for (const auto& [first, growth] : {std::pair<std::uint64_t, std::uint32_t>{2, 16},
                                      {1, 1},
                                      {8, 3},
                                      {1000, 64},
                                      {Limits::max_iterations, 1}}) {
    const Epochs epochs(first, growth);
    std::uint64_t e = 0;
    for (; epochs.begin(e) < Limits::max_iterations; ++e) {
      const std::uint64_t begin = epochs.begin(e), end = epochs.begin(e + 1);
      ASSERT_LT(begin, end);
      ASSERT_EQ(begin % 2, 0U);
      ASSERT_EQ(epochs.of_iteration(begin), e);
      ASSERT_EQ(epochs.of_iteration(end - 1), e);
      ASSERT_EQ(epochs.of_index(epochs.begin_index(e)), e);
      ASSERT_EQ(epochs.of_index(epochs.begin_index(e + 1) - 1), e);
    }
    EXPECT_EQ(epochs.of_iteration(Limits::max_iterations - 1), e - 1);
  }
}

// The borders by the recurrence itself, one after the other.
std::vector<std::uint64_t> literal_borders(std::uint64_t first, std::uint32_t growth) {
  std::vector<std::uint64_t> borders{0};
  while (borders.back() < Limits::max_iterations) {
    const std::uint64_t length = std::max(first, borders.back() / growth);
    borders.push_back(borders.back() + length + length % 2);
  }
  return borders;
}

// Claim: borders and epochs are those of the recurrence up to the limit and beyond it, for every length of a
// table that settings allow: all of a short one, and of a long one its ends and many places between.
TEST(Epochs, AreThoseOfTheRecurrenceUpToTheLimit) {
  const std::pair<std::uint64_t, std::uint32_t> plans[] = {{2, 1},
                                                           {1, 1},
                                                           {3, 1},
                                                           {2, 2},
                                                           {5, 3},
                                                           {8, 16},
                                                           {7, 16},
                                                           {999, 64},
                                                           {2, 100},
                                                           {1000000, 7},
                                                           {2, 4096},
                                                           {1, 65535},
                                                           {3, 65536},
                                                           {2, 65536},
                                                           {64, 65536},
                                                           {1 << 20, 65536},
                                                           {Limits::max_iterations, 65536}};
  std::uint64_t seed = 1;
  for (const auto& [first, growth] : plans) {
    SCOPED_TRACE(testing::Message() << first << " " << growth);
    const std::vector<std::uint64_t> borders = literal_borders(first, growth);
    const Epochs epochs(first, growth);
    const std::uint64_t last = borders.size() - 1;
    const auto expect_border = [&](std::uint64_t e) {
      ASSERT_EQ(epochs.begin(e), borders[e]) << e;
      ASSERT_EQ(epochs.of_iteration(borders[e]), e);
      ASSERT_EQ(epochs.of_iteration(borders[e + 1] - 1), e);
    };
    const bool is_short = last < 600;
    for (std::uint64_t e = 0; e < std::min<std::uint64_t>(last, 600); ++e) expect_border(e);
    for (int i = 0; i < 6 && !is_short; ++i) expect_border(rng::key(seed++, last) % last);
    for (std::uint64_t e = last - std::min<std::uint64_t>(last, 3); e < last; ++e) expect_border(e);
    EXPECT_EQ(epochs.begin(last), borders[last]);
    EXPECT_EQ(epochs.of_iteration(borders[last]), last);
    EXPECT_EQ(epochs.begin(last + 1), borders[last]);
    EXPECT_EQ(epochs.begin(std::numeric_limits<std::uint64_t>::max()), borders[last]);
    EXPECT_EQ(epochs.of_iteration(std::numeric_limits<std::uint64_t>::max()), last);
  }
}

// Claim: with a lag the state of an epoch waits for the epochs before its lag, and the first ones for none.
TEST(Epochs, StatesLag) {
  EXPECT_EQ(epochs_before(0, 0), 0U);
  EXPECT_EQ(epochs_before(1, 0), 1U);
  EXPECT_EQ(epochs_before(1, 1), 0U);
  EXPECT_EQ(epochs_before(2, 1), 1U);
  EXPECT_EQ(epochs_before(9, 4), 5U);
}

}  // namespace
}  // namespace candela
