// Objects against the vocabulary.
#pragma once

#include <span>

#include "common/base/result.h"
#include "common/description/object.h"
#include "common/description/vocabulary.h"

namespace candela::description {

// Names, types, values and bounds of the properties; brings values into their canonical form (lower case of a
// closed set, numbers for named indices of refraction). Then what no single rule can say: parameters that
// exclude each other.
Result<void> check_properties(Object& object, const PluginRule& rule);

// Categories, slots and numbers of the children, and required parameters. `child_where[i]` is where child i
// was written or referred to.
Result<void> check_children(const Object& object, const PluginRule& rule,
                            std::span<const Location> child_where);

// "bsdf 'diffuse'", "the scene"
std::string describe(const Object& object);

}  // namespace candela::description
