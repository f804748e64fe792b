// Borders of epochs.
#include <gtest/gtest.h>

#include "common/job/job.h"
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
