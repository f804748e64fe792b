// The layers that Mitsuba's integrator `aov` asks for beside the image of the integrator inside it.
#pragma once

#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/description/object.h"

namespace candela::description {

// The value of its parameter `aovs` as parse_aovs() of common/job/aov.h reads it. Kinds that Mitsuba has and
// Candela lacks are left out and told in `passed_over`; so is what Mitsuba does not have either, if
// `lenient`. Otherwise that is an error.
Result<std::string> aovs_of_scene(const Property& aovs, bool lenient, std::vector<Note>& passed_over);

}  // namespace candela::description
