#include "common/description/stand_in.h"

#include <fmt/format.h>

#include <algorithm>

#include "common/description/check.h"
#include "common/description/element_names.h"
#include "common/description/legacy.h"
#include "common/description/lenient.h"
#include "common/description/scene_aovs.h"
#include "common/description/text.h"

namespace candela::description::stand_in {

std::string_view category_of(const pugi::xml_node& node) {
  const std::string_view name = node.name();
  const std::string_view type = node.attribute("type").value();
  const bool is_texture = name == "spectrum" && find_plugin("spectrum", type) == nullptr &&
                          find_plugin("texture", type) != nullptr;
  return is_texture ? std::string_view("texture") : name;
}

std::optional<std::size_t> integrator_inside(const std::vector<Draft>& drafts, std::size_t index,
                                             std::vector<Note>& notes) {
  for (const Link& link : drafts[index].links) {
    if (link.is_reference || drafts[link.target].object->category != "integrator") continue;
    const Object& outer = *drafts[index].object;
    if (!is_layer_element(outer.plugin) || drafts[index].links.size() > 1)
      notes.push_back({outer.where, fmt::format("{}: only the integrator inside, '{}', runs", describe(outer),
                                                drafts[link.target].object->plugin)});
    return link.target;
  }
  return std::nullopt;
}

const PluginRule* direct_as_path(Object& object) {
  if (object.category != "integrator" || object.plugin != "direct") return nullptr;
  object.plugin = "path";
  std::erase_if(object.properties, [](const Property& property) {
    return property.name == "shading_samples" || property.name == "emitter_samples" ||
           property.name == "bsdf_samples" || property.name == "max_depth";
  });
  object.properties.push_back({"max_depth", PropertyType::integer, std::int64_t{2}, object.where});
  return find_plugin("integrator", "path");
}

const PluginRule* replace_unknown(std::vector<Draft>& drafts,
                                  const std::map<std::string, std::size_t, std::less<>>& ids,
                                  std::size_t index, std::vector<Note>& passed_over) {
  Draft& draft = drafts[index];
  Object& object = *draft.object;
  const auto is_bsdf = [&](const Link& link) {
    if (!link.is_reference) return drafts[link.target].object->category == "bsdf";
    const auto known = ids.find(link.id);  // references to what comes later are not counted
    return known != ids.end() && drafts[known->second].object->category == "bsdf";
  };
  const auto parts = std::count_if(draft.links.begin(), draft.links.end(), is_bsdf);
  const std::string original = object.plugin;
  const std::string what = unknown_plugin(object.where, object.category, original).message;
  const std::string nearest = lenient::nearest_plugin(object, static_cast<std::size_t>(parts));
  if (nearest.empty()) {
    draft.left_out = true;
    passed_over.push_back({object.where, fmt::format("{}: it is left out", what)});
    return nullptr;
  }
  object.plugin = nearest;
  draft.stands_in = true;
  passed_over.push_back({object.where, fmt::format("{}: it is read as {}", what, text::quote(nearest))});
  lenient::adopt(object, original);
  const PluginRule* rule = find_plugin(object.category, nearest);
  for (Link& link : draft.links) {
    if (link.slot.empty() || find_rule(*rule, link.slot) != nullptr) continue;
    const std::string_view meant = lenient::meant_parameter(*rule, link.slot);
    if (!meant.empty()) link.slot = std::string(meant);
  }
  return rule;
}

void rename_unknown(const Object& object, const PluginRule& rule, Property& property,
                    std::vector<Note>& passed_over) {
  const std::string_view meant = lenient::meant_parameter(rule, property.name);
  if (meant.empty() || object.find(meant) != nullptr) return;
  Property renamed = property;
  renamed.name = std::string(meant);
  if (!check_property(renamed, *find_rule(rule, meant)).ok()) return;
  passed_over.push_back({property.where, fmt::format("{} has no parameter {}: it is read as '{}'",
                                                     describe(object), text::quote(property.name), meant)});
  property = std::move(renamed);
}

void pass_over_unknown(Draft& draft, const PluginRule& rule, bool lenient, std::vector<Note>& passed_over) {
  Object& object = *draft.object;
  if (!draft.legacy && !lenient && !draft.stands_in) return;
  const bool may_rename = draft.stands_in || (lenient && !draft.legacy);
  for (Property& property : object.properties)
    if (may_rename && find_rule(rule, property.name) == nullptr)
      rename_unknown(object, rule, property, passed_over);
  std::erase_if(object.properties, [&](const Property& property) {
    if (find_rule(rule, property.name) != nullptr) return false;
    if (!lenient && legacy::is_heeded(object, property.name)) return false;
    passed_over.push_back(passed_over_note(unknown_parameter(object, rule, property.where, property.name)));
    return true;
  });
}

void drop_unfit(Object& object, const PluginRule& rule, std::vector<Note>& passed_over) {
  std::erase_if(object.properties, [&](Property& property) {
    const PropertyRule* property_rule = find_rule(rule, property.name);
    if (property_rule == nullptr) return false;  // told elsewhere
    const Result<void> fits = check_property(property, *property_rule);
    if (fits.ok()) return false;
    passed_over.push_back(passed_over_note(fits.error()));
    return true;
  });
}

std::optional<Property> take_normal_map_file(Draft& draft) {
  const auto has_map = [](const Link& link) { return link.slot == "normalmap"; };
  std::vector<Property>& properties = draft.object->properties;
  const auto named = std::find_if(properties.begin(), properties.end(),
                                  [](const Property& property) { return property.name == "filename"; });
  if (named == properties.end() || !std::holds_alternative<std::string>(named->value) ||
      std::any_of(draft.links.begin(), draft.links.end(), has_map))
    return std::nullopt;
  Property name = std::move(*named);
  properties.erase(named);
  return name;
}

std::shared_ptr<Object> raw_bitmap(Property filename) {
  auto texture = std::make_shared<Object>();
  texture->category = "texture";
  texture->plugin = "bitmap";
  texture->where = filename.where;
  texture->properties = {filename, {"raw", PropertyType::boolean, true, filename.where}};
  return texture;
}

}  // namespace candela::description::stand_in
