// Names of layers: what can be a group of channels in an EXR, each once, no more than a film can hold.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "common/film/layers.h"

namespace candela::film {
namespace {

TEST(FilmLayers, TakesNamesOfTechniques) {
  EXPECT_TRUE(validate_layer_names({}).ok());
  EXPECT_TRUE(validate_layer_names({"s2.t3", "weighted.s2.t3", "unweighted.s2.t3", "Merge_2-x"}).ok());
  std::vector<std::string> most;
  for (std::uint32_t i = 1; i < kMaxLayers; ++i) most.push_back(fmt::format("s{}", i));
  EXPECT_TRUE(validate_layer_names(most).ok());
  EXPECT_TRUE(validate_layer_names({std::string(kMaxLayerNameBytes, 'n')}).ok());
}

// Claim: each fault is a usage error of the field `layers` that says what is wrong, in printable characters.
TEST(FilmLayers, RefusesWhatCannotNameALayer) {
  std::vector<std::string> too_many;
  for (std::uint32_t i = 0; i < kMaxLayers; ++i) too_many.push_back(fmt::format("s{}", i));
  const std::pair<std::vector<std::string>, std::string> cases[] = {
      {{""}, "empty"},
      {{"a", ""}, "empty"},
      {{"a b"}, "other characters"},
      {{"a\nb"}, "other characters"},
      {{"\xc3\xa4"}, "other characters"},
      {{std::string("a\0b", 3)}, "other characters"},
      {{"2nd"}, "begin with a letter"},
      {{".a"}, "begin with a letter"},
      {{"a."}, "empty"},
      {{"a..b"}, "empty"},
      {{"error"}, "error estimate"},
      {{std::string(kMaxLayerNameBytes + 1, 'n')}, "longer than"},
      {{std::string(100000, '\t')}, "longer than"},
      {{"s2.t3", "x", "s2.t3"}, "two layers are called 's2.t3'"},
      {too_many, "more than 63"},
  };
  for (const auto& [names, words] : cases) {
    const auto result = validate_layer_names(names);
    ASSERT_FALSE(result.ok()) << words;
    EXPECT_EQ(result.error().kind, ErrorKind::usage);
    EXPECT_EQ(result.error().field, "layers");
    EXPECT_NE(result.error().message.find(words), std::string::npos) << result.error().message;
    EXPECT_LT(result.error().message.size(), 200U);
    for (const char c : result.error().message) EXPECT_TRUE(c >= ' ' && c <= '~');
  }
}

// Claim: a film that is too large with its layers is refused with the number that would fit.
TEST(FilmLayers, RefusesFilmsTooLarge) {
  const auto fits = make_layout(16384, 16384, {"a", "b", "c"});
  ASSERT_TRUE(fits.ok());
  EXPECT_EQ(*fits, (Layout{16384, 16384, 4}));
  EXPECT_TRUE(validate(*fits, 0).ok());
  const auto too_large = make_layout(16384, 16384, {"a", "b", "c", "d"});
  ASSERT_FALSE(too_large.ok());
  EXPECT_EQ(too_large.error().kind, ErrorKind::usage);
  EXPECT_NE(too_large.error().mend.find("at most 3 fit"), std::string::npos) << too_large.error().mend;
  EXPECT_EQ(*make_layout(70, 40, {}), (Layout{70, 40, 1}));
}

}  // namespace
}  // namespace candela::film
