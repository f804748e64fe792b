// The lenient reading replaces plugins and parameters that Candela does not know.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "common/description/object.h"
#include "common/description/vocabulary.h"

namespace candela::description::lenient {

// True if another plugin gives the picture of `object`'s but for polarization or for a width next to none, so
// that it stands in without --lenient too.
bool has_close_plugin(const Object& object);

// The plugin that `object`, whose plugin is unknown, is read as. Empty: no plugin is near, and the object is
// left out. `bsdf_parts`: the number of bsdfs inside a bsdf.
std::string nearest_plugin(const Object& object, std::size_t bsdf_parts);

// Gives an object that has become one of `rule` (`original`: its plugin as written) the parameters that the
// new plugin needs to look like the old one.
void adopt(Object& object, std::string_view original);

// The parameter of `rule` that an unknown parameter `name` stands for under another name ("toWorld",
// "baseColor"); empty: none.
std::string_view meant_parameter(const PluginRule& rule, std::string_view name);

// The value that the lenient reading assumes for a $parameter without one; empty: none is usual.
std::string_view usual_value(std::string_view parameter);

}  // namespace candela::description::lenient
