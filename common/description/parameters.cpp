#include "common/description/parameters.h"

#include <fmt/format.h>

#include <vector>

#include "common/description/lenient.h"
#include "common/description/text.h"
#include "common/description/vocabulary.h"

namespace candela::description {
namespace {

// Attributes do not grow beyond this by substitution: a hostile scene stays small.
constexpr std::size_t max_attribute_bytes = std::size_t{16} << 20;
constexpr std::size_t max_parameter_bytes = std::size_t{256} << 20;

bool is_name_character(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
}

}  // namespace

Parameters::Parameters(const std::map<std::string, std::string>& given, bool assumes_usual)
    : assumes_usual_(assumes_usual) {
  for (const auto& [name, text] : given) values_[name] = {text, true, false};
}

void Parameters::add_default(const std::string& name, const std::string& value) {
  values_.try_emplace(name, Value{value, false, false});
}

// The longest name that `rest` starts with, as Mitsuba does. Of all names up to a text, its prefixes
// included, the last is either a prefix or bounds how long a prefix can be: what it has in common with the
// text.
Parameters::Values::iterator Parameters::longest_name(std::string_view rest) {
  while (!rest.empty()) {
    auto candidate = values_.upper_bound(rest);
    if (candidate == values_.begin()) break;
    --candidate;
    const std::string& name = candidate->first;
    if (name.empty()) break;
    if (rest.starts_with(name)) return candidate;
    std::size_t common = 0;
    while (common < name.size() && common < rest.size() && name[common] == rest[common]) ++common;
    rest = rest.substr(0, common);
  }
  return values_.end();
}

Parameters::Values::iterator Parameters::assume(std::string_view name) {
  const std::string_view usual = lenient::usual_value(name);
  if (usual.empty()) return values_.end();
  assumed_.emplace_back(name, usual);
  return values_.try_emplace(std::string(name), Value{std::string(usual), false, false}).first;
}

Result<std::string> Parameters::substitute(std::string_view text) {
  std::string result;
  while (!text.empty()) {
    if (text.starts_with("\\$")) {
      result += '$';
      text.remove_prefix(2);
      continue;
    }
    if (text.front() != '$') {
      result += text.front();
      text.remove_prefix(1);
      continue;
    }
    const std::string_view rest = text.substr(1);
    auto best = longest_name(rest);
    std::size_t length = 0;
    while (length < rest.size() && is_name_character(rest[length])) ++length;
    const std::string_view name = rest.substr(0, length);
    if (best == values_.end() && assumes_usual_) best = assume(name);
    if (best == values_.end()) {
      std::vector<std::string_view> known;
      for (const auto& [other, value] : values_) known.push_back(other);
      const std::string_view nearest = nearest_name(name, known);
      const std::string shown = text::quote(text.substr(0, 1 + length));
      return input_error(fmt::format("the parameter {} has no value", shown))
          .with_mend(nearest.empty()
                         ? fmt::format("give it one with -D {}=..., or by a <default> before this line", name)
                         : text::did_you_mean(fmt::format("${}", nearest)));
    }
    best->second.used = true;
    result += best->second.text;
    text.remove_prefix(1 + best->first.size());
    total_bytes_ += best->second.text.size();
    if (total_bytes_ > max_parameter_bytes)
      return input_error(fmt::format("the scene's attributes grow by more than {} bytes by their parameters",
                                     max_parameter_bytes));
    if (result.size() > max_attribute_bytes)
      return input_error(
          fmt::format("an attribute grows beyond {} bytes by its parameters", max_attribute_bytes));
  }
  return result;
}

Result<void> Parameters::check_all_used() const {
  std::vector<std::string_view> known;
  for (const auto& [name, value] : values_)
    if (!value.given || value.used) known.push_back(name);
  for (const auto& [name, value] : values_) {
    if (!value.given || value.used) continue;
    const std::string_view nearest = nearest_name(name, known);
    return input_error(fmt::format("the scene does not use the parameter {}", text::quote(name)))
        .with_mend(known.empty()     ? "it uses none"
                   : nearest.empty() ? fmt::format("it uses {}", text::quoted_list(known))
                                     : text::did_you_mean(nearest));
  }
  return {};
}

}  // namespace candela::description
