// Sets of sequence indices as text.
#include <gtest/gtest.h>

#include <limits>

#include "common/film/index_text.h"
#include "common/job/job.h"
#include "common/rng/stream.h"

namespace candela::film {
namespace {

IndexSet set_of(std::initializer_list<std::pair<std::uint64_t, std::uint64_t>> ranges) {
  IndexSet set;
  for (const auto& [begin, end] : ranges) EXPECT_TRUE(set.insert(begin, end));
  return set;
}

// Claim: the text of a set is the shortest list of its ranges, last index included.
TEST(IndexText, ListsRanges) {
  EXPECT_EQ(text_of(IndexSet()), "none");
  EXPECT_EQ(text_of(set_of({{0, 32}, {40, 48}, {50, 51}})), "0-31,40-47,50");
  EXPECT_EQ(text_of(HalfSets{set_of({{3, 5}}), IndexSet()}), "3-4/none");
}

// Claim: whatever the set, its text is read back as the set.
TEST(IndexText, IsReadBack) {
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    rng::Stream stream(rng::key(seed, 7));
    HalfSets sets;
    for (IndexSet& set : sets)
      for (std::uint64_t at = 0; stream.next_double() < 0.9;) {
        const auto step = [&] { return 1 + static_cast<std::uint64_t>(stream.next_double() * 9); };
        const std::uint64_t begin = at + (at == 0 && stream.next_double() < 0.5 ? 0 : step());
        at = begin + step();
        set.insert(begin, at);
      }
    if (empty(sets)) continue;
    const auto back = parse_half_indices(text_of(sets));
    ASSERT_TRUE(back.ok()) << text_of(sets);
    EXPECT_EQ(*back, sets);
  }
}

// Claim: text of another form, ranges out of order, touching, backwards or beyond the limit, and sets without
// an index or of more ranges than an argument of a command holds are refused.
TEST(IndexText, RefusesAllElse) {
  const std::string limit = std::to_string(Limits::max_iterations);
  for (const std::string& bad : {std::string(),
                                 std::string("0-31"),
                                 std::string("/"),
                                 std::string("0/"),
                                 std::string("/0"),
                                 std::string("0/0/0"),
                                 std::string("none/none"),
                                 std::string("5-3/0"),
                                 std::string("0-3,2-5/0"),
                                 std::string("0-3,4-5/0"),
                                 std::string("7,3/0"),
                                 std::string("0,,2/0"),
                                 std::string("0-/0"),
                                 std::string("-3/0"),
                                 std::string("+1/0"),
                                 std::string("0 -3/0"),
                                 std::string("0x3/0"),
                                 std::string("0,/0"),
                                 std::string("0-99999999999999999999/0"),
                                 limit + "/0",
                                 "0-" + limit + "/0",
                                 std::string("18446744073709551615/0")})
    EXPECT_FALSE(parse_half_indices(bad).ok()) << bad;
  EXPECT_TRUE(parse_half_indices(std::to_string(Limits::max_iterations - 1) + "/0").ok());

  IndexSet most;
  for (std::uint64_t i = 0; i + 1 < kMaxIndexRanges; ++i) most.insert(2 * i, 2 * i + 1);
  HalfSets sets{most, set_of({{0, 1}})};
  EXPECT_TRUE(parse_half_indices(text_of(sets)).ok());
  sets[1].insert(5, 6);
  EXPECT_FALSE(parse_half_indices(text_of(sets)).ok());
  EXPECT_FALSE(check_indices(sets).ok());
  constexpr std::size_t kArgumentBytes = 131072;  // of Linux
  most = {};
  for (std::uint64_t i = 0; i < kMaxIndexRanges; ++i)
    most.insert(Limits::max_iterations - 4 * i - 2, Limits::max_iterations - 4 * i);
  EXPECT_LT(text_of(HalfSets{most, {}}).size(), kArgumentBytes);
}

}  // namespace
}  // namespace candela::film
