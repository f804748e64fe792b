#include "common/description/parameters.h"

#include <fmt/format.h>

#include <vector>

#include "common/description/text.h"
#include "common/description/vocabulary.h"

namespace candela::description {
namespace {

// Attributes do not grow beyond this by substitution: a hostile scene stays small.
constexpr std::size_t max_attribute_bytes = std::size_t{16} << 20;

bool is_name_character(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
}

}  // namespace

Parameters::Parameters(const std::map<std::string, std::string>& given) {
  for (const auto& [name, text] : given) values_[name] = {text, true, false};
}

void Parameters::add_default(const std::string& name, const std::string& value) {
  values_.try_emplace(name, Value{value, false, false});
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
    // The longest name that `rest` starts with, as Mitsuba does.
    auto best = values_.end();
    for (auto it = values_.begin(); it != values_.end(); ++it)
      if (!it->first.empty() && rest.starts_with(it->first) &&
          (best == values_.end() || it->first.size() > best->first.size()))
        best = it;
    if (best == values_.end()) {
      std::size_t length = 0;
      while (length < rest.size() && is_name_character(rest[length])) ++length;
      const std::string_view name = rest.substr(0, length);
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
