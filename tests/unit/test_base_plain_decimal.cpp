// The quick reading of plain decimals beside std::from_chars.
#include <gtest/gtest.h>

#include <bit>
#include <charconv>
#include <cstdint>
#include <string>

#include "common/base/plain_decimal.h"
#include "common/rng/stream.h"

namespace candela {
namespace {

// Claim: what is read as a plain decimal has the bits and the end that std::from_chars finds, zeros with a
// sign, leading zeros and points without digits behind them included.
TEST(PlainDecimal, IsAsFromChars) {
  rng::Stream stream(47);
  int read = 0;
  for (int round = 0; round < 200000; ++round) {
    std::string text = stream.next_u32() % 3 == 0 ? "-" : "";
    const auto digits = [&](std::uint32_t most) {
      for (std::uint32_t n = stream.next_u32() % (most + 1); n > 0; --n)
        text += static_cast<char>('0' + stream.next_u32() % (stream.next_u32() % 4 == 0 ? 1 : 10));
    };
    digits(9);
    if (stream.next_u32() % 4 != 0) {
      text += '.';
      digits(9);
    }
    text += std::string(" \n]x").substr(stream.next_u32() % 4, 1);
    const char *begin = text.data(), *end = begin + text.size();
    double quick = 0, slow = 0;
    const char* const stop = read_plain_decimal(begin, end, quick);
    if (stop == nullptr) continue;
    ++read;
    const auto [rest, code] = std::from_chars(begin, end, slow);
    ASSERT_EQ(code, std::errc()) << text;
    EXPECT_EQ(stop, rest) << text;
    EXPECT_EQ(std::bit_cast<std::uint64_t>(quick), std::bit_cast<std::uint64_t>(slow)) << text;
  }
  EXPECT_GT(read, 100000) << "most are plain";
}

// Claim: nothing that would be rounded twice is read, nor what is no number; an exponent ends it.
TEST(PlainDecimal, LeavesTheRest) {
  double value = 0;
  for (const std::string text : {"", "-", ".", ".5", "-.5", "+1", "inf", "nan", " 1", "1234567890123456",
                                 "0.1234567890123456", "123456789.1234567", "123456789012345.6"})
    EXPECT_EQ(read_plain_decimal(text.data(), text.data() + text.size(), value), nullptr) << text;
  const std::string exponent = "12.5e3";
  EXPECT_EQ(read_plain_decimal(exponent.data(), exponent.data() + exponent.size(), value),
            exponent.data() + 4);
}

}  // namespace
}  // namespace candela
