#include "common/description/element.h"

#include <fmt/format.h>

#include "common/description/text.h"

namespace candela::description {

Result<Element> read_element(const XmlDocument& document, const pugi::xml_node& node, bool legacy,
                             Parameters& parameters) {
  constexpr std::size_t max_attributes = 32;
  Element result;
  result.name = node.name();
  result.where = document.where(node);
  result.legacy = legacy;
  for (const pugi::xml_attribute& attribute : node.attributes()) {
    const std::string_view name = attribute.name();
    if (result.find(name) != nullptr)
      return result.error(fmt::format("attribute {} of <{}> is given twice", text::quote(name), result.name));
    if (result.attributes.size() >= max_attributes)
      return result.error(fmt::format("<{}> has more than {} attributes", result.name, max_attributes));
    const std::string_view value = attribute.value();
    if (value.find('$') == std::string_view::npos) {
      result.attributes.emplace_back(name, value);
      continue;
    }
    Result<std::string> substituted = parameters.substitute(value);
    if (!substituted.ok()) return std::move(substituted).error().at(result.where.file, result.where.line);
    result.attributes.emplace_back(name, std::move(substituted).value());
  }
  return result;
}

Error unexpected_text(const XmlDocument& document, const pugi::xml_node& node) {
  std::string_view words = node.value();
  Location where = document.where(node);
  while (!words.empty() && (words.front() == ' ' || words.front() == '\t' || words.front() == '\n')) {
    where.line += words.front() == '\n' ? 1 : 0;
    words.remove_prefix(1);
  }
  words = words.substr(0, words.find('\n'));
  return input_error(fmt::format("unexpected text {} in <{}>", text::quote(words), node.parent().name()))
      .at(where.file, where.line);
}

}  // namespace candela::description
