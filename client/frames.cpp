#include "client/frames.h"

#include <fmt/format.h>

#include <set>

#include "client/values.h"

namespace candela::client {
namespace {

constexpr std::uint64_t kMaxFrame = 99999999;
constexpr std::size_t kMaxFrames = 10000;

}  // namespace

Result<std::vector<std::int32_t>> parse_frames(std::string_view text, std::string_view option) {
  const auto bad = [&] {
    return usage_error(fmt::format("'{}' is no range of frames from 0 to {}", printable(text), kMaxFrame))
        .with_field(std::string(option))
        .with_mend("write 1-240, 1-240x2 for every second one, or 1,5,9-20");
  };
  std::vector<std::int32_t> out;
  std::set<std::int32_t> seen;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t comma = std::min(text.find(',', at), text.size());
    std::string_view part = text.substr(at, comma - at);
    at = comma + 1;
    std::uint64_t step = 1;
    const std::size_t x = part.find('x'), dash = part.find('-');
    if (x != std::string_view::npos) {
      const auto value = parse_count(part.substr(x + 1), option, 1, kMaxFrame);
      if (!value.ok() || dash == std::string_view::npos) return bad();
      step = *value;
      part = part.substr(0, x);
    }
    const auto first = parse_count(part.substr(0, dash), option, 0, kMaxFrame);
    const auto last =
        dash == std::string_view::npos ? first : parse_count(part.substr(dash + 1), option, 0, kMaxFrame);
    if (!first.ok() || !last.ok() || *last < *first) return bad();
    for (std::uint64_t frame = *first; frame <= *last; frame += step) {
      if (!seen.insert(static_cast<std::int32_t>(frame)).second) continue;
      if (out.size() == kMaxFrames)
        return usage_error(fmt::format("more than {} frames", kMaxFrames))
            .with_field(std::string(option))
            .with_mend("submit them in several groups");
      out.push_back(static_cast<std::int32_t>(frame));
    }
  }
  return out;
}

std::string group_name_of(std::string_view pattern) {
  constexpr std::string_view kAround = "._- #";
  const auto trimmed = [&](std::string_view text) {
    const std::size_t begin = text.find_first_not_of(kAround);
    if (begin == std::string_view::npos) return std::string_view();
    return text.substr(begin, text.find_last_not_of(kAround) - begin + 1);
  };
  std::string out;
  for (;;) {
    const std::size_t open = std::min(pattern.find("{frame}"), pattern.find("{frame:"));
    const std::string_view part = trimmed(pattern.substr(0, open));
    if (!part.empty()) out += (out.empty() ? "" : ".") + std::string(part);
    if (open == std::string_view::npos) return out;
    pattern.remove_prefix(std::min(pattern.find('}', open) + 1, pattern.size()));
  }
}

}  // namespace candela::client
