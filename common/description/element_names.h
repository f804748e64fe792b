// The names that elements of a scene file may have, and the errors for those that have none of them.
#pragma once

#include <optional>
#include <string_view>

#include "common/base/result.h"
#include "common/description/object.h"

namespace candela::description {

// The first number of a scene file's version: "0.6.0", "3.0.0", "2.1". Nothing if the text is not a version.
std::optional<int> major_version(std::string_view text);

// Elements that make objects: bsdf, shape, emitter ...
bool is_category(std::string_view name);
// Neither Mitsuba nor Candela has an element of this name.
bool is_unknown_element(std::string_view name);

// Errors (input) that name the place and the nearest known name.
Error unknown_element(const Location& where, std::string_view name);
Error unknown_plugin(const Location& where, std::string_view category, std::string_view name);

}  // namespace candela::description
