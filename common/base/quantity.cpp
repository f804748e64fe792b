#include "common/base/quantity.h"

#include <charconv>
#include <cmath>

namespace candela {
namespace {

constexpr double kMaxSeconds = 1e9;  // 32 years: clocks count milliseconds of it without overflow

}  // namespace

std::optional<double> parse_seconds(std::string_view text) {
  const char* const end = text.data() + text.size();
  double number = 0;
  const auto [rest, code] = std::from_chars(text.data(), end, number);
  if (code != std::errc() || std::signbit(number)) return std::nullopt;
  const std::string_view suffix(rest, static_cast<std::size_t>(end - rest));
  if (suffix == "m")
    number *= 60;
  else if (suffix == "h")
    number *= 3600;
  else if (suffix == "d")
    number *= 86400;
  else if (!suffix.empty() && suffix != "s")
    return std::nullopt;
  if (!(number <= kMaxSeconds)) return std::nullopt;
  return number;
}

std::optional<std::uint64_t> parse_bytes(std::string_view text) {
  const char* const end = text.data() + text.size();
  std::uint64_t number = 0;
  const auto [rest, code] = std::from_chars(text.data(), end, number);
  if (code != std::errc() || number == 0) return std::nullopt;
  const std::string_view suffix(rest, static_cast<std::size_t>(end - rest));
  int shift = 0;
  if (suffix == "K" || suffix == "KiB")
    shift = 10;
  else if (suffix == "M" || suffix == "MiB")
    shift = 20;
  else if (suffix == "G" || suffix == "GiB")
    shift = 30;
  else if (suffix == "T" || suffix == "TiB")
    shift = 40;
  else if (!suffix.empty())
    return std::nullopt;
  if (number > (UINT64_MAX >> 1 >> shift)) return std::nullopt;
  return number << shift;
}

std::optional<double> parse_share(std::string_view text) {
  const char* const end = text.data() + text.size();
  double number = 0;
  const auto [rest, code] = std::from_chars(text.data(), end, number);
  if (code != std::errc() || std::signbit(number)) return std::nullopt;
  const std::string_view suffix(rest, static_cast<std::size_t>(end - rest));
  if (suffix == "%")
    number /= 100;
  else if (!suffix.empty())
    return std::nullopt;
  if (!(number <= 1)) return std::nullopt;
  return number;
}

}  // namespace candela
