// The lenient reading replaces values that the rules refuse by the nearest value that they accept, or else by
// the default. `passed_over` gets a note on each change.
#pragma once

#include <vector>

#include "common/description/object.h"
#include "common/description/values.h"
#include "common/description/vocabulary.h"

namespace candela::description::repair {

// Properties that the rule has. The others, and required ones that nothing can mend, stay as they are, and
// stay errors.
void properties(Object& object, const PluginRule& rule, std::vector<Note>& passed_over);

// An <srgb> with its numbers between 0 and 1; other elements as they are.
Element srgb(Element element, std::vector<Note>& passed_over);

// Numbers of 0.6 that legacy::upgrade turns into others. Before it.
void old_numbers(Object& object, std::vector<Note>& passed_over);

// A conductor's metal that nobody has measured is no metal at all. Before legacy::upgrade.
void material(Object& object, std::vector<Note>& passed_over);

}  // namespace candela::description::repair
