#include "common/description/other_integrator.h"

#include <fmt/format.h>

#include "common/description/check.h"
#include "common/description/element.h"
#include "common/description/resolve.h"
#include "common/description/text.h"
#include "common/description/vocabulary.h"

namespace candela::description {
namespace {

constexpr int max_foreign_depth = 64;

// True if the parameter has an effect; others are accepted for Mitsuba's sake.
bool is_used(const PropertyRule* rule) {
  return rule != nullptr && !rule->ignored && rule->only.empty();
}

// The name as messages print it.
std::string plugin_name(std::string_view written) {
  const std::string quoted = text::quote(canonical_plugin("integrator", written));
  return quoted.substr(1, quoted.size() - 2);
}

}  // namespace

// A $parameter that has no value stays as it is.
std::string OtherIntegrator::text_of(const pugi::xml_node& node, const char* attribute) const {
  const std::string_view raw = node.attribute(attribute).value();
  Result<std::string> substituted = parameters.substitute(raw);
  return substituted.ok() ? std::move(substituted).value() : std::string(raw);
}

Result<std::shared_ptr<Object>> OtherIntegrator::read(const pugi::xml_node& node, int depth) const {
  auto object = std::make_shared<Object>();
  object->category = "integrator";
  object->plugin = plugin_name(text_of(node, "type"));
  object->id = text_of(node, "id");
  object->where = document.where(node);
  CANDELA_TRY(walk(node, object->plugin, *object, depth));
  return object;
}

Result<void> OtherIntegrator::walk(const pugi::xml_node& node, std::string_view plugin, Object& into,
                                   int depth) const {
  if (depth > max_foreign_depth) {
    const Location where = document.where(node);
    return input_error(fmt::format("elements are nested deeper than {} levels", max_foreign_depth))
        .at(where.file, where.line);
  }
  for (const pugi::xml_node& child : node.children()) {
    const std::string_view name = child.name();
    if (child.type() == pugi::node_element && is_value_element(name)) {
      CANDELA_TRY(take(child, plugin, into));
    } else if (name == "integrator") {
      CANDELA_TRY(walk(child, plugin_name(text_of(child, "type")), into, depth + 1));
    } else {
      if (name == "default" && *child.attribute("name").value() != 0)
        parameters.add_default(text_of(child, "name"), text_of(child, "value"));
      // Its parameters count as used all the same.
      for (const pugi::xml_attribute& attribute : child.attributes()) text_of(child, attribute.name());
      Object nobody;
      CANDELA_TRY(walk(child, {}, nobody, depth + 1));
    }
  }
  return {};
}

Result<void> OtherIntegrator::take(const pugi::xml_node& node, std::string_view plugin, Object& into) const {
  const std::string written = text_of(node, "name");
  const std::string name = legacy ? text::snake_case(written) : written;
  const PluginRule* own = find_plugin("integrator", plugin);
  const PluginRule* running = find_plugin("integrator", runs);
  const PropertyRule* own_rule = own == nullptr ? nullptr : find_rule(*own, name);
  const PropertyRule* rule = running == nullptr ? nullptr : find_rule(*running, name);
  const auto parse = [&]() -> Result<Property> {
    CANDELA_ASSIGN(const Element element, read_element(document, node, legacy, parameters));
    CANDELA_ASSIGN(Property property, parse_value(element));
    property.name = name;
    if (own_rule != nullptr) CANDELA_TRY(check_property(property, *own_rule));
    return property;
  };
  Result<Property> property = parse();
  if (plugin == "aov" && name == "aovs" && property.ok() && requests.aovs.empty()) {
    // Another integrator runs: what of its layers cannot be had does not keep it from running.
    Result<std::string> list = aovs_of_scene(*property, true, notes);
    if (list.ok())
      requests.aovs = std::move(list).value();
    else
      notes.push_back(passed_over_note(list.error()));
  }
  if (plugin == "lpe" && name == "layers" && property.ok() && requests.layers.empty()) {
    // Ours: any integrator can have them.
    CANDELA_ASSIGN(requests.layers, layers_of_scene(*property));
  }
  if (plugin == "edits" && name == "edits" && property.ok() && requests.edits.empty()) {
    CANDELA_ASSIGN(requests.edits, read_scene_edits(*property));
  }
  if (!property.ok() && is_used(own_rule)) return std::move(property).error();
  if (own != nullptr && own == running) {
    if (own_rule == nullptr)
      notes.push_back(passed_over_note(unknown_parameter(into, *own, document.where(node), name)));
    else if (!property.ok())
      notes.push_back(passed_over_note(property.error()));
  } else if (!is_used(rule) || !property.ok() || !check_property(*property, *rule).ok()) {
    return {};
  }
  if (rule != nullptr && property.ok() && into.find(name) == nullptr)
    into.properties.push_back(std::move(property).value());
  return {};
}

}  // namespace candela::description
