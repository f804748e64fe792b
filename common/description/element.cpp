#include "common/description/element.h"

#include <fmt/format.h>

#include "common/description/check.h"
#include "common/description/element_names.h"
#include "common/description/text.h"
#include "common/description/transform.h"

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

Result<bool> is_legacy(const XmlDocument& document, const pugi::xml_node& root, bool otherwise) {
  const pugi::xml_attribute version = root.attribute("version");
  if (!version) return otherwise;
  const std::optional<int> major = major_version(version.value());
  if (!major)
    return error_at(document.where(root), fmt::format("{} is not a version", text::quote(version.value())))
        .with_mend("write it as '3.0.0'");
  return *major < 2;
}

std::string modern_name(bool legacy, std::string_view name) {
  return legacy ? text::snake_case(name) : std::string(name);
}

Result<void> check_name(const Element& element, std::string_view attribute) {
  const std::string_view name = element.get(attribute);
  if (!element.legacy && name.starts_with('_'))
    return element.error(
        fmt::format("{} {} starts with an underscore, which is reserved", attribute, text::quote(name)));
  return {};
}

Result<void> check_transform(const Element& written, const Mat4& matrix) {
  const std::string name = text::quote(written.get("name"));
  if (!transform::is_finite(matrix))
    return written.error(fmt::format("the transform {} is not finite", name));
  if (!transform::is_invertible(matrix))
    return written.error(fmt::format("the transform {} is singular", name))
        .with_mend("it flattens space; scale by a small number instead of 0");
  return {};
}

Result<void> expect_element(const XmlDocument& document, const pugi::xml_node& node) {
  if (node.type() == pugi::node_element) return {};
  return unexpected_text(document, node);
}

Result<void> no_children(const XmlDocument& document, const pugi::xml_node& node) {
  const pugi::xml_node child = node.first_child();
  if (!child) return {};
  CANDELA_TRY(expect_element(document, child));
  return error_at(document.where(child),
                  fmt::format("<{}> cannot be inside <{}>", child.name(), node.name()));
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
