// Which layers of a job add up to its image.
#include "common/letters/partition.h"

#include <gtest/gtest.h>

namespace candela::letters {
namespace {

using Names = std::vector<std::string>;

// Claim: light groups add up, and all expressions of a partition; expressions that may overlap do not, nor
// do layers of the integrator, whatever they are called.
TEST(Partition, AreGroupsOrAllExpressions) {
  const Names film = {"a", "light.b", "light.key", "weighted.s2.t3"};
  EXPECT_EQ(partition_of("", film), Names());
  EXPECT_EQ(partition_of("layer a=L[DGSV]*E; layer light.b=LE", film), Names());
  EXPECT_EQ(partition_of("layer a=L[DGSV]*E; layer light.b=LE; partition", film), (Names{"a", "light.b"}));
  EXPECT_EQ(partition_of("layer a=LE; layer light.b=LDE; light-groups", film), (Names{"light.key"}));
  EXPECT_EQ(partition_of("light-groups", film), (Names{"light.b", "light.key"}));
  EXPECT_EQ(partition_of("layer a=LE; light-groups; partition", film), (Names{"a", "light.b", "light.key"}));
  EXPECT_EQ(partition_of("light-groups", Names()), Names()) << "before the pilot";
  EXPECT_EQ(partition_of("nonsense", film), Names());
}

// Claim: the layers come in the order of the film, whatever that of the request.
TEST(Partition, KeepsTheOrderOfTheFilm) {
  const std::string request = "layer b=LE; layer a=L[XV]+E; partition";
  EXPECT_EQ(partition_of(request, Names{"a", "b"}), (Names{"a", "b"}));
  EXPECT_EQ(partition_of(request, Names{"b", "x", "a"}), (Names{"b", "a"}));
}

}  // namespace
}  // namespace candela::letters
