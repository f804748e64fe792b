// Chains of jobs with and without layers by light path expressions. Seeds are fixed: nothing here is left to
// chance.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "tests/statistical/chain_driver.h"
#include "tests/statistical/layered_room.h"

namespace candela::statistical {
namespace {

class ChainsWithLayers : public testing::TestWithParam<std::string> {};

// Claim: chains go the same way with layers, for so many mutations that a number which only one of both
// kernels reads would have led them apart.
TEST_P(ChainsWithLayers, GoTheSameWay) {
  const auto sums = [&](const Layers& layers) {
    return render_chains({layered_room(GetParam(), {}, layers), 64}, 5).sums;
  };
  const auto plain = sums({}), layered = sums({{"seen", "LE"}});
  ASSERT_EQ(plain.size(), 2 * kRoomValues);
  ASSERT_EQ(layered.size(), 2 * plain.size());
  EXPECT_TRUE(std::equal(plain.begin(), plain.end(), layered.begin()));
}
INSTANTIATE_TEST_SUITE_P(, ChainsWithLayers, testing::Values("pssmlt", "mmlt", "mlt"),
                         [](const auto& one) { return one.param; });

}  // namespace
}  // namespace candela::statistical
