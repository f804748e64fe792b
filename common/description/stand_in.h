// Objects that stand in for plugins that Candela lacks.
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <pugixml.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "common/description/object.h"
#include "common/description/resolve.h"
#include "common/description/vocabulary.h"

namespace candela::description::stand_in {

// The category of an element. A spectrum whose plugin is a texture is a texture: Mitsuba 3 makes no
// difference between the two.
std::string_view category_of(const pugi::xml_node& node);

// The first integrator inside of an integrator that Candela lacks ("aov", "moment"): it runs alone.
std::optional<std::size_t> integrator_inside(const std::vector<Draft>& drafts, std::size_t index,
                                             std::vector<Note>& notes);

// 'direct' is path tracing of direct light. Its two numbers of samples change noise only. Null: the object is
// another integrator.
const PluginRule* direct_as_path(Object& object);

// Under the lenient reading: the nearest plugin takes the place of an unknown one. Null: the object is left
// out.
const PluginRule* replace_unknown(std::vector<Draft>& drafts,
                                  const std::map<std::string, std::size_t, std::less<>>& ids,
                                  std::size_t index, std::vector<Note>& passed_over);

// Reads an unknown parameter as the one that it is another name of.
void rename_unknown(const Object& object, const PluginRule& rule, Property& property,
                    std::vector<Note>& passed_over);

// Drops the parameters that the plugin does not have, where that is no error: in files before version 2, of a
// plugin that stands in, and under the lenient reading.
void pass_over_unknown(Draft& draft, const PluginRule& rule, bool lenient, std::vector<Note>& passed_over);

// Takes the property `filename` from a normal map that has no texture. Nothing: it has one, or no such name.
std::optional<Property> take_normal_map_file(Draft& draft);
// The texture of a file whose values are no colors.
std::shared_ptr<Object> raw_bitmap(Property filename);

// Drops the properties that the rule does not accept.
void drop_unfit(Object& object, const PluginRule& rule, std::vector<Note>& passed_over);

}  // namespace candela::description::stand_in
