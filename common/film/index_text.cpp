#include "common/film/index_text.h"

#include <fmt/format.h>

#include <charconv>
#include <cstdint>

#include "common/base/text.h"
#include "common/job/job.h"

namespace candela::film {
namespace {

constexpr std::string_view kNone = "none";

bool parse_number(std::string_view text, std::uint64_t& value) {
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  return code == std::errc() && end == text.data() + text.size();
}

std::string shown(std::string_view text) {
  constexpr std::size_t kMax = 40;
  return escape_unprintable(clip_utf8(text, kMax)) + (text.size() > kMax ? "..." : "");
}

}  // namespace

std::string text_of(const IndexSet& set) {
  if (set.ranges().empty()) return std::string(kNone);
  std::string text;
  for (const auto& [begin, end] : set.ranges()) {
    if (!text.empty()) text += ',';
    text += end - begin == 1 ? fmt::format("{}", begin) : fmt::format("{}-{}", begin, end - 1);
  }
  return text;
}

std::string text_of(const HalfSets& sets) {
  return text_of(sets[0]) + '/' + text_of(sets[1]);
}

Result<IndexSet> parse_indices(std::string_view text) {
  IndexSet set;
  if (text == kNone) return set;
  std::uint64_t least = 0;  // the first index that the next range may have
  for (std::string_view rest = text;;) {
    const std::size_t comma = rest.find(',');
    const std::string_view part = rest.substr(0, comma);
    const std::size_t dash = part.find('-');
    std::uint64_t first = 0, last = 0;
    if (!parse_number(part.substr(0, dash), first) ||
        !parse_number(dash == std::string_view::npos ? part : part.substr(dash + 1), last))
      return usage_error(fmt::format("'{}' is not a range of indices", shown(part)))
          .with_mend("write ranges such as 0-31,40-47, or none");
    if (last < first) return usage_error(fmt::format("the range '{}' ends before it begins", shown(part)));
    if (last >= Limits::max_iterations)
      return usage_error(
          fmt::format("the index {} is beyond the limit of {}", last, Limits::max_iterations - 1));
    if (first < least)
      return usage_error(
                 fmt::format("the range '{}' does not come after the one before, or touches it", shown(part)))
          .with_mend("sort the ranges, and join those that touch");
    set.insert(first, last + 1);
    least = last + 2;
    if (comma == std::string_view::npos) return set;
    rest.remove_prefix(comma + 1);
  }
}

Result<HalfSets> parse_half_indices(std::string_view text) {
  const std::size_t slash = text.find('/');
  if (slash == std::string_view::npos || text.find('/', slash + 1) != std::string_view::npos)
    return usage_error(fmt::format("'{}' is not a set of indices for each half", shown(text)))
        .with_mend("write those of half A, a slash, and those of half B, such as 0-31/0-31");
  HalfSets sets;
  CANDELA_ASSIGN(sets[0], parse_indices(text.substr(0, slash)));
  CANDELA_ASSIGN(sets[1], parse_indices(text.substr(slash + 1)));
  CANDELA_TRY(check_indices(sets));
  return sets;
}

Result<void> check_indices(const HalfSets& sets) {
  if (empty(sets)) return usage_error("there is no index").with_mend("give at least one");
  const std::size_t ranges = sets[0].ranges().size() + sets[1].ranges().size();
  if (ranges > kMaxIndexRanges)
    return usage_error(
        fmt::format("{} ranges of indices are more than the limit of {}", ranges, kMaxIndexRanges));
  for (const IndexSet& set : sets)
    if (!set.ranges().empty() && set.ranges().rbegin()->second > Limits::max_iterations)
      return usage_error(fmt::format("the index {} is beyond the limit of {}",
                                     set.ranges().rbegin()->second - 1, Limits::max_iterations - 1));
  return {};
}

}  // namespace candela::film
