// JSON that people write: faults name the line, equal keys are one, and nesting has a bound. Users link
// nlohmann_json.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/base/text.h"

namespace candela {

// Keys keep their order. Errors: input.
inline Result<nlohmann::ordered_json> parse_strict_json(std::string_view text, int max_nesting) {
  using Json = nlohmann::ordered_json;
  // The parser keeps the last of two equal keys, and nests without a bound.
  std::vector<std::set<std::string>> keys;
  std::string twice;
  bool deep = false;
  const auto watch = [&](int depth, Json::parse_event_t event, Json& parsed) {
    deep |= depth > max_nesting;
    if (event == Json::parse_event_t::object_start) keys.emplace_back();
    if (event == Json::parse_event_t::object_end && !keys.empty()) keys.pop_back();
    if (event == Json::parse_event_t::key && !keys.empty() &&
        !keys.back().insert(parsed.get<std::string>()).second)
      twice = parsed.get<std::string>();
    return !deep;
  };
  Json json;
  try {
    json = Json::parse(text.begin(), text.end(), watch);
  } catch (const Json::parse_error& error) {
    const std::size_t end = std::min(error.byte, text.size());
    const auto line = 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(end), '\n');
    return input_error(fmt::format("it is no JSON at line {}", line))
        .with_mend("look for a comma or a quote");
  } catch (const Json::exception& error) {
    return input_error("it cannot be read as JSON: a number is too large");
  }
  if (deep) return input_error(fmt::format("it nests deeper than {} levels", max_nesting));
  if (!twice.empty()) return input_error(fmt::format("the key {} is given twice", quote(twice)));
  return json;
}

}  // namespace candela
