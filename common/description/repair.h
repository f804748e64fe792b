// The lenient reading replaces values that the rules refuse by the nearest value that they accept, or else by
// the default. `passed_over` gets a note on each change.
#pragma once

#include <vector>

#include "common/description/object.h"
#include "common/description/vocabulary.h"

namespace candela::description::repair {

// Properties that the rule has. The others, required ones that nothing can mend, and numbers below a bound
// that is itself excluded stay as they are, and stay errors.
void properties(Object& object, const PluginRule& rule, std::vector<Note>& passed_over);

// A conductor's metal that nobody has measured is no metal at all. Before legacy::upgrade.
void material(Object& object, std::vector<Note>& passed_over);

}  // namespace candela::description::repair
