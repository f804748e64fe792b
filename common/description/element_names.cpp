#include "common/description/element_names.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <vector>

#include "common/description/check.h"
#include "common/description/text.h"
#include "common/description/values.h"
#include "common/description/vocabulary.h"

namespace candela::description {
namespace {

constexpr std::array<std::string_view, 7> structure_elements = {"scene", "ref",  "default",  "include",
                                                                "alias", "path", "transform"};
// Mitsuba 0.6 has these; nothing stands for them yet.
constexpr std::array<std::string_view, 1> later_elements = {"animation"};

// For messages: fit to print, without the quotes.
std::string bare(std::string_view name) {
  const std::string quoted = text::quote(name);
  return quoted.substr(1, quoted.size() - 2);
}

}  // namespace

std::optional<int> major_version(std::string_view text) {
  std::optional<int> major;
  while (true) {
    int number = 0;
    const auto [stop, code] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (code != std::errc() || number < 0) return std::nullopt;
    if (!major) major = number;
    text.remove_prefix(static_cast<std::size_t>(stop - text.data()));
    if (text.empty()) return major;
    if (text.front() != '.') return std::nullopt;
    text.remove_prefix(1);
  }
}

bool is_category(std::string_view name) {
  static const std::vector<std::string_view> names = category_names();
  return std::find(names.begin(), names.end(), name) != names.end();
}

bool is_unknown_element(std::string_view name) {
  const auto is_one_of = [&](const auto& names) {
    return std::find(names.begin(), names.end(), name) != names.end();
  };
  return !is_category(name) && !is_value_element(name) && !is_transform_operation(name) &&
         name != "spectrum" && name != "blackbody" && !is_one_of(structure_elements) &&
         !is_one_of(later_elements) && support_of_category(name) != Support::later;
}

Error unknown_element(const Location& where, std::string_view name) {
  if (support_of_category(name) == Support::later ||
      std::find(later_elements.begin(), later_elements.end(), name) != later_elements.end())
    return error_at(where, fmt::format("<{}> is not supported yet", name));
  std::vector<std::string_view> known = category_names();
  known.insert(known.end(), structure_elements.begin(), structure_elements.end());
  for (const std::string_view value :
       {"boolean", "integer", "float", "string", "point", "vector", "rgb", "srgb", "spectrum", "blackbody"})
    known.push_back(value);
  return error_at(where, fmt::format("unknown element <{}>", bare(name)))
      .with_mend(text::did_you_mean(nearest_name(name, known)));
}

Error unknown_plugin(const Location& where, std::string_view category, std::string_view name) {
  const std::vector<std::string_view> known = plugin_names(category);
  if (support_of_plugin(category, name) == Support::later)
    return error_at(where, fmt::format("{} {} is not supported yet", category, text::quote(name)))
        .with_mend(fmt::format("there is {}", text::quoted_list(known)));
  const std::string_view nearest = nearest_name(name, known);
  const std::string_view choose = category == "integrator" ? "; --integrator NAME chooses one" : "";
  return error_at(where, fmt::format("unknown {} {}", category, text::quote(name)))
      .with_mend(nearest.empty() ? fmt::format("there is {}{}", text::quoted_list(known), choose)
                                 : text::did_you_mean(nearest));
}

}  // namespace candela::description
