// A wall clock that is set back.
#include <gtest/gtest.h>

#include "common/base/set_back_watch.h"

namespace candela {
namespace {

using Seconds = SetBackWatch::Seconds;

// Claim: time that passes, a clock that is set forward, and steps back within the limit are nothing; more is
// told once, with how much it is.
TEST(SetBackWatch, TellsStepsBackOnce) {
  SetBackWatch watch(Seconds(5));
  EXPECT_FALSE(watch.look(Seconds(1e9), Seconds(100)));
  EXPECT_FALSE(watch.look(Seconds(1e9 + 50), Seconds(150)));
  EXPECT_FALSE(watch.look(Seconds(1e9 + 48), Seconds(151))) << "3 s back";
  const auto back = watch.look(Seconds(1e9 - 3600 + 51), Seconds(152));
  ASSERT_TRUE(back);
  EXPECT_NEAR(back->count(), 3601, 1e-3);
  EXPECT_FALSE(watch.look(Seconds(1e9 - 3600 + 52), Seconds(153))) << "it was told";
  EXPECT_FALSE(watch.look(Seconds(2e9), Seconds(154))) << "forward";
  ASSERT_TRUE(watch.look(Seconds(2e9 - 10), Seconds(155))) << "back again, from there";
}

// Claim: small steps back add up, since gRPC waits for all of them.
TEST(SetBackWatch, AddsSmallSteps) {
  SetBackWatch watch(Seconds(5));
  double wall = 1e9;
  int told = 0;
  for (int i = 0; i < 8; ++i, wall += 1 - 2) told += watch.look(Seconds(wall), Seconds(i)) ? 1 : 0;
  EXPECT_EQ(told, 2) << "2 s a step: after the third and the sixth";
}

// Claim: this machine's clocks agree while nobody sets them.
TEST(SetBackWatch, IsSilentHere) {
  SetBackWatch watch(Seconds(3600));
  EXPECT_FALSE(watch.look());
  EXPECT_FALSE(watch.look());
}

}  // namespace
}  // namespace candela
