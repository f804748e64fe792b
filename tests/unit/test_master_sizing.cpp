// Numbers of iterations of units.
#include <gtest/gtest.h>

#include "master/scheduler/sizing.h"

namespace candela::master {
namespace {

// Claim: sizes follow cost, the end of the job, the overhead of a delta, and a time limit.
TEST(Sizing, FollowsItsRules) {
  SizingInput in;
  in.unit_seconds = 4;
  EXPECT_EQ(unit_iterations(in), 1U) << "unknown cost";
  in.cut_so_far = 1'000'000;
  in.seconds_per_iteration = 0.1;
  EXPECT_EQ(unit_iterations(in), 40U);
  in.remaining = 100;
  in.active_workers = 5;
  EXPECT_EQ(unit_iterations(in), 10U) << "guided";
  in.remaining = 3;
  EXPECT_EQ(unit_iterations(in), 1U);
  in.remaining = 0;
  in.overhead_seconds = 0.2;  // 2 % of 10 s
  EXPECT_EQ(unit_iterations(in), 100U);
  in.seconds_left = 8;
  EXPECT_EQ(unit_iterations(in), 10U);
  in.open_end = true;
  in.cut_so_far = 0;
  EXPECT_EQ(unit_iterations(in), 2U) << "a sixteenth of unit_seconds before anything is known";
  in.cut_so_far = 240;
  EXPECT_EQ(unit_iterations(in), 6U) << "an eighth of what was cut, for five workers";
  in.seconds_per_iteration = 100;
  EXPECT_EQ(unit_iterations(in), 1U);
}

// Claim: however many workers there are, merging their deltas takes two fifths of the time, and in the end
// less than rendering what is left.
TEST(Sizing, SparesTheMerge) {
  SizingInput in;
  in.unit_seconds = 4;
  in.seconds_per_iteration = 0.1;
  in.merge_seconds = 0.04;
  in.active_workers = 20;
  in.cut_so_far = 1'000'000'000;
  EXPECT_EQ(unit_iterations(in), 40U) << "0.8 s for every 4";
  in.active_workers = 1000;
  EXPECT_EQ(unit_iterations(in), 1000U) << "a round of merges takes 40 s";
  in.active_workers = 10000;
  EXPECT_EQ(unit_iterations(in), 2560U) << "64 times unit_seconds";
  in.active_workers = 1000;
  in.remaining = 10000;  // 1000 s of work: 158 units of 6.3 s, merged in 6.3 s
  EXPECT_EQ(unit_iterations(in), 63U);
  in.remaining = 1;
  EXPECT_EQ(unit_iterations(in), 1U);
  in.remaining = 0;
  in.open_end = true;
  in.cut_so_far = 16;
  EXPECT_EQ(unit_iterations(in), 400U) << "hardly anything is cut yet: as the merge can take";
  in.cut_so_far = 4'000'000;
  EXPECT_EQ(unit_iterations(in), 500U);
}

// Claim: the first units of a job are short, of as many workers as there may be, so that both halves of a
// picture are there soon; then units grow as what is cut does.
TEST(Sizing, BeginsWithShortUnits) {
  SizingInput in;
  in.unit_seconds = 4;
  in.seconds_per_iteration = 0.05;
  in.merge_seconds = 0.1;
  in.remaining = 1'000'000;
  in.active_workers = 1000;
  EXPECT_EQ(unit_iterations(in), 5U) << "a sixteenth of 4 s";
  in.cut_so_far = 5;
  EXPECT_EQ(unit_iterations(in), 5U) << "of the other half";
  in.cut_so_far = 35;
  EXPECT_EQ(unit_iterations(in), 5U) << "the eighth: one of the first may come late";
  in.cut_so_far = 40;
  EXPECT_GT(unit_iterations(in), 400U) << "the merge of a thousand deltas takes 100 s";
  in.active_workers = 4;
  in.cut_so_far = 80;
  EXPECT_EQ(unit_iterations(in), 20U) << "as much for each as is cut already";
  in.cut_so_far = 100'000;
  EXPECT_EQ(unit_iterations(in), 80U);
}

}  // namespace
}  // namespace candela::master
