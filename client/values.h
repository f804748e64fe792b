// Values as people type and read them: counts, durations, sizes, targets, assignments. Every parser takes the
// option's name, so that its one error line says where the bad value was given.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "common/base/result.h"
#include "common/base/shell_words.h"

namespace candela::client {

// A decimal integer in [least, most].
Result<std::uint64_t> parse_count(std::string_view text, std::string_view option, std::uint64_t least,
                                  std::uint64_t most);
Result<std::int64_t> parse_integer(std::string_view text, std::string_view option, std::int64_t least,
                                   std::int64_t most);
// A finite number in [least, most].
Result<double> parse_number(std::string_view text, std::string_view option, double least, double most);

struct Interval {
  double low = 0, high = 0;
};
// "LOW,HIGH", both within [least, most], low below high.
Result<Interval> parse_interval(std::string_view text, std::string_view option, double least, double most);

// Seconds above 0 of "90s", "10m", "1h30m", "2d", "500ms", "1.5h", or a bare number of seconds. Units go from
// large to small, each at most once. At most ten years.
Result<double> parse_duration(std::string_view text, std::string_view option);

struct Size {
  std::uint32_t width = 0;   // pixels
  std::uint32_t height = 0;  // pixels
};
// "WIDTHxHEIGHT", each within 1 and Limits::max_extent, together at most Limits::max_pixels.
Result<Size> parse_size(std::string_view text, std::string_view option);

struct CropWindow {
  std::uint32_t x = 0, y = 0, width = 0, height = 0;  // pixels
};
// "X,Y,WIDTH,HEIGHT", the window not empty, each at most Limits::max_extent.
Result<CropWindow> parse_crop(std::string_view text, std::string_view option);

// The target of "relmse=1e-3": above 0.
Result<double> parse_until(std::string_view text, std::string_view option);

// "name=value"; the name is not empty, the value may be.
Result<std::pair<std::string, std::string>> parse_assignment(std::string_view text, std::string_view option);

// `text` if it is one of `known`, else an error with the nearest of them, or all.
Result<std::string> parse_choice(std::string_view text, std::string_view option,
                                 std::span<const std::string_view> known);

// Sets `target` to what parse(text, option, bounds...) makes of an option that is given.
template <class T, class Parse, class... Bounds>
Result<void> set_if_given(T& target, const std::optional<std::string>& text, const char* option,
                          const Parse& parse, const Bounds&... bounds) {
  if (!text) return {};
  CANDELA_ASSIGN(target, parse(*text, option, bounds...));
  return {};
}

std::string format_duration(double seconds);    // "0.4s", "12s", "3m05s", "1h02m", "2d03h"
std::string format_count(double count);         // "950", "12.3k", "4.56M", "1.20G"
std::string format_bytes(std::uint64_t bytes);  // "950 B", "1.2 MiB"

// One line fit for a terminal (escape_unprintable() of common/base/text.h). For text that came from files or
// peers: whatever a table, a line of progress or an error shows of such text has gone through here.
std::string printable(std::string_view text);

// "a, b, c" of strings. (fmt::join trips a false alarm of GCC 12's -Wstringop-overflow.)
template <class Range>
std::string join(const Range& parts, std::string_view separator) {
  std::string text;
  bool first = true;
  for (const auto& part : parts) {
    if (!first) text += separator;
    first = false;
    text += part;
  }
  return text;
}

}  // namespace candela::client
