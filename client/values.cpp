#include "client/values.h"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <cmath>

#include "common/base/text.h"
#include "common/description/vocabulary.h"
#include "common/job/job.h"
#include "common/job/stop_limits.h"

namespace candela::client {
namespace {

Error bad_value(std::string_view text, std::string_view option, std::string_view wanted) {
  return usage_error(fmt::format("'{}' is not {}", printable(text), wanted)).with_field(std::string(option));
}

// from_chars over the whole of `text`.
template <class T>
bool parse_whole(std::string_view text, T& value) {
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  return code == std::errc() && end == text.data() + text.size();
}

}  // namespace

Result<std::uint64_t> parse_count(std::string_view text, std::string_view option, std::uint64_t least,
                                  std::uint64_t most) {
  std::uint64_t value = 0;
  if (!parse_whole(text, value) || value < least || value > most)
    return bad_value(text, option, fmt::format("a whole number from {} to {}", least, most));
  return value;
}

Result<std::int64_t> parse_integer(std::string_view text, std::string_view option, std::int64_t least,
                                   std::int64_t most) {
  std::int64_t value = 0;
  if (!parse_whole(text, value) || value < least || value > most)
    return bad_value(text, option, fmt::format("a whole number from {} to {}", least, most));
  return value;
}

Result<double> parse_number(std::string_view text, std::string_view option, double least, double most) {
  double value = 0;
  if (!parse_whole(text, value) || !std::isfinite(value) || value < least || value > most)
    return bad_value(text, option, fmt::format("a number from {} to {}", least, most));
  return value;
}

Result<Interval> parse_interval(std::string_view text, std::string_view option, double least, double most) {
  const std::size_t comma = text.find(',');
  if (comma == std::string::npos)
    return usage_error(fmt::format("'{}' is not LOW,HIGH", printable(text))).with_field(std::string(option));
  Interval interval;
  CANDELA_ASSIGN(interval.low, parse_number(text.substr(0, comma), option, least, most));
  CANDELA_ASSIGN(interval.high, parse_number(text.substr(comma + 1), option, least, most));
  if (!(interval.low < interval.high))
    return usage_error(fmt::format("the range '{}' is empty", printable(text)))
        .with_field(std::string(option))
        .with_mend("give the lower number first, then a higher one");
  return interval;
}

Result<double> parse_duration(std::string_view text, std::string_view option) {
  constexpr std::string_view wanted = "a duration such as 90s, 10m or 1h30m";
  struct UnitOfTime {
    std::string_view name;
    double seconds;
  };
  // "ms" before "m": the longer name is tried first; `rank` keeps the order of size.
  constexpr std::array<UnitOfTime, 5> units = {
      {{"d", 86400}, {"h", 3600}, {"ms", 0.001}, {"m", 60}, {"s", 1}}};
  double total = 0;
  double last_unit = INFINITY;
  std::string_view rest = text;
  if (rest.empty()) return bad_value(text, option, wanted);
  while (!rest.empty()) {
    double value = 0;
    const auto [end, code] =
        std::from_chars(rest.data(), rest.data() + rest.size(), value, std::chars_format::fixed);
    if (code != std::errc() || !(value >= 0)) return bad_value(text, option, wanted);
    rest.remove_prefix(static_cast<std::size_t>(end - rest.data()));
    double unit = 1;
    if (!rest.empty()) {
      const UnitOfTime* found = nullptr;
      for (const auto& candidate : units)
        if (found == nullptr && rest.starts_with(candidate.name)) found = &candidate;
      if (found == nullptr) return bad_value(text, option, wanted);
      unit = found->seconds;
      rest.remove_prefix(found->name.size());
    } else if (std::isfinite(last_unit)) {
      return bad_value(text, option, wanted);  // "1h30": thirty of what?
    }
    if (!(unit < last_unit)) return bad_value(text, option, wanted);
    last_unit = unit;
    total += value * unit;
  }
  if (!(total > 0)) return bad_value(text, option, "a duration above 0");
  if (total > kMaxStopSeconds) return bad_value(text, option, "a duration of at most ten years");
  return total;
}

Result<Size> parse_size(std::string_view text, std::string_view option) {
  const std::size_t x = text.find('x');
  Size size;
  if (x == std::string_view::npos || !parse_whole(text.substr(0, x), size.width) ||
      !parse_whole(text.substr(x + 1), size.height) || size.width < 1 || size.height < 1 ||
      size.width > Limits::max_extent || size.height > Limits::max_extent)
    return bad_value(
        text, option,
        fmt::format("a size such as 1280x720, each side from 1 to {} pixels", Limits::max_extent));
  if (std::uint64_t{size.width} * size.height > Limits::max_pixels)
    return bad_value(text, option, fmt::format("a size of at most {} pixels in all", Limits::max_pixels));
  return size;
}

Result<CropWindow> parse_crop(std::string_view text, std::string_view option) {
  CropWindow crop;
  std::string_view rest = text;
  bool good = true;
  for (std::uint32_t* number : {&crop.x, &crop.y, &crop.width, &crop.height}) {
    const std::string_view one = rest.substr(0, rest.find(','));
    good = good && parse_whole(one, *number) && *number <= Limits::max_extent;
    rest.remove_prefix(std::min(rest.size(), one.size() + (number == &crop.height ? 0 : 1)));
  }
  if (!good || !rest.empty() || crop.width < 1 || crop.height < 1)
    return bad_value(text, option, "a window such as 640,360,200,100: left, top, width and height in pixels");
  return crop;
}

Result<double> parse_until(std::string_view text, std::string_view option) {
  const std::size_t equals = text.find('=');
  if (equals == std::string_view::npos || text.substr(0, equals) != "relmse")
    return bad_value(text, option, "a target such as relmse=1e-3");
  double value = 0;
  if (!parse_whole(text.substr(equals + 1), value) || !(value > 0 && value <= kMaxStopRelmse))
    return bad_value(text, option,
                     fmt::format("a target such as relmse=1e-3, above 0 and at most {}", kMaxStopRelmse));
  return value;
}

Result<std::pair<std::string, std::string>> parse_assignment(std::string_view text, std::string_view option) {
  const std::size_t equals = text.find('=');
  if (equals == std::string_view::npos || equals == 0)
    return bad_value(text, option, "of the form name=value");
  return std::pair{std::string(text.substr(0, equals)), std::string(text.substr(equals + 1))};
}

Result<std::string> parse_choice(std::string_view text, std::string_view option,
                                 std::span<const std::string_view> known) {
  for (const std::string_view name : known)
    if (name == text) return std::string(text);
  const std::string_view near = description::nearest_name(text, known);
  Error error =
      usage_error(fmt::format("unknown value '{}'", printable(text))).with_field(std::string(option));
  error.mend =
      near.empty() ? fmt::format("there is {}", join(known, ", ")) : fmt::format("did you mean '{}'?", near);
  return error;
}

std::string format_duration(double seconds) {
  if (!std::isfinite(seconds) || seconds < 0) return "?";
  if (seconds < 9.95) return fmt::format("{:.1f}s", seconds);
  const auto s = static_cast<std::uint64_t>(std::llround(std::min(seconds, 1e15)));
  if (s < 60) return fmt::format("{}s", s);
  if (s < 3600) return fmt::format("{}m{:02}s", s / 60, s % 60);
  if (s < 86400) return fmt::format("{}h{:02}m", s / 3600, s % 3600 / 60);
  return fmt::format("{}d{:02}h", s / 86400, s % 86400 / 3600);
}

std::string format_count(double count) {
  if (!std::isfinite(count)) return "?";
  constexpr std::array<const char*, 5> suffixes = {"", "k", "M", "G", "T"};
  std::size_t i = 0;
  while (std::abs(count) >= 999.5 && i + 1 < suffixes.size()) {
    count /= 1000;
    ++i;
  }
  if (i == 0) return fmt::format("{:.0f}", count);
  const int digits = std::abs(count) < 9.995 ? 2 : std::abs(count) < 99.95 ? 1 : 0;
  return fmt::format("{:.{}f}{}", count, digits, suffixes[i]);
}

std::string format_bytes(std::uint64_t bytes) {
  constexpr std::array<const char*, 5> suffixes = {"B", "KiB", "MiB", "GiB", "TiB"};
  double value = static_cast<double>(bytes);
  std::size_t i = 0;
  while (value >= 1023.95 && i + 1 < suffixes.size()) {
    value /= 1024;
    ++i;
  }
  return i == 0 ? fmt::format("{} B", bytes) : fmt::format("{:.1f} {}", value, suffixes[i]);
}

std::string printable(std::string_view text) {
  return escape_unprintable(text);
}

}  // namespace candela::client
