// Text from elsewhere: in logs, and as people see it.
#include "common/base/text.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "common/base/log.h"

namespace candela {
namespace {

// Claim: what would end a line, steer a terminal or hide itself becomes an escape; letters of all languages
// and backslashes stay; escaping twice is escaping once.
TEST(Text, UnprintableIsEscaped) {
  const std::pair<const char*, const char*> cases[] = {
      {"plain", "plain"},
      {"caf\u00e9 \u65e5\u672c \U0001f600 \\n", "caf\u00e9 \u65e5\u672c \U0001f600 \\n"},
      {"a\nb\r\tc", "a\\nb\\r\\tc"},
      {"\x1b[2J\x7f", "\\x1b[2J\\x7f"},
      {"\u0085\u009b", "\\u0085\\u009b"},
      {"gpj\u202exe", "gpj\\u202exe"},
      {"\u2066a\u2069\u200b\u200f\ufeff\u00ad\u2028", "\\u2066a\\u2069\\u200b\\u200f\\ufeff\\u00ad\\u2028"},
      {"\U000e0041", "\\U000e0041"},
      {"\xff\xc3", "\\xff\\xc3"},
      {"\xed\xa0\x80", "\\xed\\xa0\\x80"},  // a surrogate
  };
  for (const auto& [text, shown] : cases) {
    EXPECT_EQ(escape_unprintable(text), shown);
    EXPECT_EQ(escape_unprintable(shown), shown);
  }
}

// Claim: JSON stays the JSON of the same text; only how it is written changes.
TEST(Text, JsonKeepsItsMeaning) {
  EXPECT_EQ(escape_json_unprintable("{\n  \"a\": \"\u202e\U000e0041\u00e9\x7f\"\n}"),
            "{\n  \"a\": \"\\u202e\\udb40\\udc41\u00e9\\u007f\"\n}");
}

// Claim: a text is cut before a character, not within one.
TEST(Text, ClipsBetweenCharacters) {
  EXPECT_EQ(clip_utf8("ab\u00e9", 3), "ab");
  EXPECT_EQ(clip_utf8("ab\u00e9", 4), "ab\u00e9");
  EXPECT_EQ(clip_utf8("\U0001f600", 3), "");
}

class LogLine : public testing::TestWithParam<const char*> {
 protected:
  void TearDown() override { ASSERT_TRUE(log::initialise("test", "off", "text").ok()); }
};

// Claim: one call is one line of valid UTF-8 without control characters, whatever message and ids hold.
TEST_P(LogLine, NamesCannotForgeOne) {
  testing::internal::CaptureStderr();
  ASSERT_TRUE(log::initialise("test", "info", GetParam()).ok());
  log::info("registered 'a\n2026-01-01 00:00:00.000 error forged\x1b[2J\u202e\xff\"'",
            {.job = "j\n1", .unit = 7, .worker = "w\x1b"});
  log::flush();
  const std::string line = testing::internal::GetCapturedStderr();
  EXPECT_EQ(std::count(line.begin(), line.end(), '\n'), 1) << line;
  EXPECT_EQ(escape_unprintable(line.substr(0, line.size() - 1)), line.substr(0, line.size() - 1));
  for (const char* word : {"2026-01-01 00:00:00.000 error forged", "x1b[2J", "u202e", "xff", "n1", "7"})
    EXPECT_NE(line.find(word), std::string::npos) << word << " in " << line;
}
INSTANTIATE_TEST_SUITE_P(, LogLine, testing::Values("text", "json"),
                         [](const auto& format) { return std::string(format.param); });

}  // namespace
}  // namespace candela
