// Times and sizes of the servers' options.
#include <gtest/gtest.h>

#include "common/base/quantity.h"

namespace candela {
namespace {

// Claim: times are read with their units, and what is no time is refused rather than read in part.
TEST(Quantity, Seconds) {
  EXPECT_EQ(parse_seconds("2"), 2.0);
  EXPECT_EQ(parse_seconds("0"), 0.0);
  EXPECT_EQ(parse_seconds("2.5s"), 2.5);
  EXPECT_EQ(parse_seconds("10m"), 600.0);
  EXPECT_EQ(parse_seconds("1e1h"), 36000.0);
  EXPECT_EQ(parse_seconds("30d"), 2592000.0);
  for (const char* text : {"", "s", "-1", "-0", "nan", "inf", "1e10", "1e400", "1e308h", "2x", "2 s", " 2",
                           "+2", "1h30m", "2ms"})
    EXPECT_FALSE(parse_seconds(text).has_value()) << text;
}

// Claim: sizes are read with their binary multiples; 0, fractions, signs and overflow are refused.
TEST(Quantity, Bytes) {
  EXPECT_EQ(parse_bytes("1"), 1U);
  EXPECT_EQ(parse_bytes("3K"), 3072U);
  EXPECT_EQ(parse_bytes("512M"), 512ULL << 20);
  EXPECT_EQ(parse_bytes("20GiB"), 20ULL << 30);
  EXPECT_EQ(parse_bytes("1T"), 1ULL << 40);
  EXPECT_EQ(parse_bytes("9223372036854775807"), UINT64_MAX >> 1);
  for (const char* text : {"", "0", "0G", "-1", "+1", "1.5G", "G", "1g", "1GB", "1 G", "9223372036854775808",
                           "8388608T", "99999999999999999999"})
    EXPECT_FALSE(parse_bytes(text).has_value()) << text;
}

// Claim: shares are read as numbers or percents from 0 to 1; all else is refused.
TEST(Quantity, Shares) {
  EXPECT_EQ(parse_share("0"), 0.0);
  EXPECT_EQ(parse_share("1"), 1.0);
  EXPECT_EQ(parse_share("0.01"), 0.01);
  EXPECT_EQ(parse_share("1%"), 0.01);
  EXPECT_EQ(parse_share("100%"), 1.0);
  for (const char* text : {"", "%", "-1%", "-0", "1.01", "101%", "nan", "inf", "1 %", "1%%", "5"})
    EXPECT_FALSE(parse_share(text).has_value()) << text;
}

}  // namespace
}  // namespace candela
