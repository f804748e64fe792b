// Objects against the vocabulary.
#pragma once

#include <span>
#include <string>
#include <utility>

#include "common/base/result.h"
#include "common/description/object.h"
#include "common/description/vocabulary.h"

namespace candela::description {

// Names, types, values and bounds of the properties; brings values into their canonical form (lower case of a
// closed set, numbers for named indices of refraction). Then what no single rule can say: parameters that
// exclude each other.
Result<void> check_properties(Object& object, const PluginRule& rule);

// The error of a parameter `name` that the plugin does not have, naming the nearest that it has, or all.
Error unknown_parameter(const Object& object, const PluginRule& rule, const Location& where,
                        std::string_view name);

// True if the child, a texture or a medium's volume, is given for a parameter that the plugin does not have.
bool is_for_unknown_parameter(const Object& object, const PluginRule& rule, const Child& child);

// True if the child is a texture for a parameter that takes none, or that has a value already.
bool is_unfit_texture(const Object& object, const PluginRule& rule, const Child& child);

// One property against its rule; brings its value into canonical form.
Result<void> check_property(Property& property, const PropertyRule& rule);

// Categories, slots and numbers of the children, and required parameters. `child_where[i]` is where child i
// was written or referred to.
Result<void> check_children(const Object& object, const PluginRule& rule,
                            std::span<const Location> child_where);

// True if the light's to_world turns, places and scales it alone: lights with a cone or a picture.
bool is_rigid_light(const Object& object);

// A focal length is a number of millimeters.
Result<void> check_focal_length(const Object& object);

// The rule of a property; nullptr if the plugin has no such property.
const PropertyRule* find_rule(const PluginRule& plugin, std::string_view name);

inline Error error_at(const Location& where, std::string message) {
  return input_error(std::move(message)).at(where.file, where.line);
}

// "bsdf 'diffuse'", "the scene"
std::string describe(const Object& object);

}  // namespace candela::description
