// Values that people type: durations, sizes, counts, targets; and what they read back.
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "client/values.h"

namespace candela::client {
namespace {

// Claim: every documented form of a duration is read, exactly.
TEST(Values, DurationsRead) {
  const struct {
    const char* text;
    double seconds;
  } cases[] = {{"90", 90},     {"90s", 90},       {"10m", 600},   {"1h30m", 5400},  {"2d", 172800},
               {"500ms", 0.5}, {"1m500ms", 60.5}, {"1.5h", 5400}, {"1h0m5s", 3605}, {"0.25", 0.25}};
  for (const auto& c : cases) {
    const auto value = parse_duration(c.text, "--time");
    ASSERT_TRUE(value.ok()) << c.text << ": " << value.error().to_string();
    EXPECT_DOUBLE_EQ(*value, c.seconds) << c.text;
  }
}

// Claim: everything else is one usage error that names the option.
TEST(Values, BadDurationsAreUsageErrors) {
  for (const char* text :
       {"", "m", "10x", "-5s", "30m1h", "1h30", "1m1m", "0s", "0", "nan", "inf", "1e3s", "10 m", "99999d"}) {
    const auto value = parse_duration(text, "--time");
    ASSERT_FALSE(value.ok()) << text;
    EXPECT_EQ(value.error().kind, ErrorKind::usage);
    EXPECT_EQ(value.error().field, "--time");
  }
}

// Claim: sizes are within 1 and 65536 a side and 2^28 pixels, and nothing trails.
TEST(Values, Sizes) {
  const auto size = parse_size("256x144", "--size");
  ASSERT_TRUE(size.ok());
  EXPECT_EQ(size->width, 256U);
  EXPECT_EQ(size->height, 144U);
  EXPECT_TRUE(parse_size("65536x4096", "--size").ok());
  for (const char* text : {"", "256", "x", "256x", "x144", "0x1", "1x0", "65537x1", "-1x1", "1x1x1",
                           "256X144", "65536x4097", "1.5x2"})
    EXPECT_FALSE(parse_size(text, "--size").ok()) << text;
}

// Claim: counts are whole decimal numbers within their range; no sign, no hex, no wrap-around.
TEST(Values, Counts) {
  EXPECT_EQ(*parse_count("18446744073709551615", "--seed", 0, UINT64_MAX), UINT64_MAX);
  for (const char* text : {"", "-1", "+1", "0x10", "1e3", "18446744073709551616", "1 "})
    EXPECT_FALSE(parse_count(text, "--seed", 0, UINT64_MAX).ok()) << text;
  EXPECT_FALSE(parse_count("0", "--iterations", 1, 10).ok());
  EXPECT_FALSE(parse_count("11", "--iterations", 1, 10).ok());
}

// Claim: the target is relmse=X with X above 0.
TEST(Values, Until) {
  EXPECT_DOUBLE_EQ(*parse_until("relmse=1e-3", "--until"), 1e-3);
  for (const char* text :
       {"", "relmse", "relmse=", "relmse=0", "relmse=-1", "relmse=nan", "rmse=1", "relmse=1x"})
    EXPECT_FALSE(parse_until(text, "--until").ok()) << text;
}

// Claim: a misspelt choice is answered with the nearest name.
TEST(Values, ChoiceSuggestsTheNearest) {
  constexpr std::array<std::string_view, 3> known = {"box", "tent", "gaussian"};
  EXPECT_EQ(*parse_choice("tent", "--filter", known), "tent");
  const auto bad = parse_choice("gausian", "--filter", known);
  ASSERT_FALSE(bad.ok());
  EXPECT_EQ(bad.error().to_string(), "--filter: unknown value 'gausian' (did you mean 'gaussian'?)");
}

// Claim: durations and counts are shown with the digits promised.
TEST(Values, Formats) {
  EXPECT_EQ(format_duration(0.44), "0.4s");
  EXPECT_EQ(format_duration(9.96), "10s");
  EXPECT_EQ(format_duration(185), "3m05s");
  EXPECT_EQ(format_duration(3725), "1h02m");
  EXPECT_EQ(format_duration(183600), "2d03h");
  EXPECT_EQ(format_duration(std::nan("")), "?");
  EXPECT_EQ(format_count(950), "950");
  EXPECT_EQ(format_count(12345), "12.3k");
  EXPECT_EQ(format_count(999600), "1.00M");
  EXPECT_EQ(format_count(4.561e6), "4.56M");
  EXPECT_EQ(format_bytes(950), "950 B");
  EXPECT_EQ(format_bytes(1258291), "1.2 MiB");
}

// Claim: a printed command reads back as the same words, and foreign text cannot steer a terminal.
TEST(Values, QuotingAndPrinting) {
  EXPECT_EQ(shell_quote("out.exr"), "out.exr");
  EXPECT_EQ(shell_quote(""), "''");
  EXPECT_EQ(shell_quote("my scene's.xml"), "'my scene'\\''s.xml'");
  EXPECT_EQ(printable("a\x1b[2Jb\n"), "a\\x1b[2Jb\\n");
  EXPECT_EQ(printable("gpj.\u202exe"), "gpj.\\u202exe");
}

}  // namespace
}  // namespace candela::client
