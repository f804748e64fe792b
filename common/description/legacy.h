// The spelling of Mitsuba 0.6 (scene versions before 2) in today's words, as Mitsuba 3 reads such files, and
// some more.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/description/object.h"

namespace candela::description::legacy {

// Today's name of a plugin ("bump" -> "bumpmap"); the name itself where it has not changed.
std::string plugin_name(std::string_view category, std::string_view name);

// Today's name of the slot that a child is given for; the names of parameters are in snake case already.
std::string slot_name(const Object& parent, std::string_view slot);

// True if 0.6 heeds a parameter that Candela lacks, so that to pass it over would be another scene, not just
// a tidier file.
bool is_heeded(const Object& object, std::string_view parameter);

// Turns the properties of one object of an old file into today's: names, merged or split parameters, values.
// A word that means something else today, or nothing, is an error that names the mend. `notes` get every word
// that Candela reads otherwise than Mitsuba 0.6.
// `slots`: the names that the object's children are given for.
using Slots = std::vector<std::string_view>;
Result<void> upgrade(Object& object, const Slots& slots, std::vector<Note>& notes);

// 0.6's films `ldrfilm` and `mfilm` (`plugin`: the name as written) as hdrfilm, in files of any version.
void upgrade_film(Object& object, std::string_view plugin, std::vector<Note>& notes);

}  // namespace candela::description::legacy
