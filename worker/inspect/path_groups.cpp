#include "worker/inspect/path_groups.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "common/letters/expression.h"

namespace candela::inspect {
namespace {

using letters::Letter;
using letters::Side;

// The letter of the vertex at distance i from the end.
char32_t at(const PathString& string, std::size_t i, bool from_light) {
  return from_light ? string[i] : string[string.size() - 1 - i];
}

// By the next vertex, in the order of its number.
std::vector<StringGroup> split(const StringGroup& group, bool from_light) {
  std::map<char32_t, StringGroup> parts;
  const std::size_t depth = group.common.size();
  for (const auto* member : group.members) {
    const char32_t next = at(member->first, depth, from_light);
    StringGroup& part = parts[next];
    if (part.members.empty()) part.common = group.common + next;
    part.members.push_back(member);
    part.light += member->second.weight;
    part.whole = member->first.size() == part.common.size();
  }
  std::vector<StringGroup> result;
  for (auto& [next, part] : parts) result.push_back(std::move(part));
  return result;
}

bool brighter(const StringGroup& a, const StringGroup& b) {
  return a.light != b.light ? a.light > b.light : a.common < b.common;
}

}  // namespace

std::vector<StringGroup> group_strings(const std::map<PathString, Cluster>& clusters, bool from_light,
                                       std::size_t rows) {
  StringGroup all;
  for (const auto& cluster : clusters) {
    all.members.push_back(&cluster);
    all.light += cluster.second.weight;
  }
  if (all.members.empty()) return {};
  std::vector<StringGroup> open = {std::move(all)}, closed;
  while (!open.empty()) {
    const auto brightest = std::min_element(open.begin(), open.end(), brighter);
    StringGroup group = std::move(*brightest);
    open.erase(brightest);
    if (group.whole) {
      closed.push_back(std::move(group));
      continue;
    }
    std::vector<StringGroup> parts = split(group, from_light);
    if (open.size() + closed.size() + parts.size() > std::max<std::size_t>(rows, 1))
      closed.push_back(std::move(group));
    else
      std::move(parts.begin(), parts.end(), std::back_inserter(open));
  }
  std::sort(closed.begin(), closed.end(), brighter);
  return closed;
}

bool is_narrower(const PathString& a, const PathString& b, const Session& session) {
  const auto rank = [&](char32_t code) {
    return std::pair(session.objects_of_name(token_of(code).object), code);
  };
  return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end(),
                                      [&](char32_t x, char32_t y) { return rank(x) < rank(y); });
}

std::string text_of(const Token& token, const Session& session) {
  constexpr std::array<std::string_view, 6> kLetters = {"L", "E", "D", "G", "S", "V"};
  const bool any_surface = token.letter == Letter::diffuse && token.side == Side::none;
  const std::string_view letter = any_surface ? "X" : kLetters[static_cast<std::size_t>(token.letter)];
  const std::string_view side = token.side == Side::reflected     ? "R"
                                : token.side == Side::transmitted ? "T"
                                                                  : "";
  const std::string& name = session.object_name(token.object);
  if (name.empty()) return fmt::format("{}{}", letter, side);
  return fmt::format("{}{}{{{}}}", letter, side, letters::pattern_of(name));
}

std::string expression_of(const StringGroup& group, bool from_light, const Session& session) {
  std::vector<std::string> words;
  for (const char32_t code : group.common) words.push_back(text_of(token_of(code), session));
  if (words.empty()) words.emplace_back(from_light ? "L" : "E");
  if (!group.whole) {
    words.emplace_back("[DGSV]*");
    words.emplace_back(from_light ? "E" : "L");
  }
  if (!from_light) std::reverse(words.begin(), words.end());
  std::string text;
  for (const std::string& word : words) {
    if (!text.empty()) text.append(" ");
    text.append(word);
  }
  return text;
}

}  // namespace candela::inspect
