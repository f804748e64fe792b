// The layers that a scene asks for beside the image of an integrator, by an element around that integrator:
// `aov`, which is Mitsuba's, and `lpe`, which is ours.
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

// The value of the parameter `layers` of an integrator `lpe`, as parse_layer_request() of
// common/letters/request.h reads it.
Result<std::string> layers_of_scene(const Property& layers);

// True if the element makes layers and leaves the image to the integrator inside the element.
bool is_layer_element(std::string_view plugin);

}  // namespace candela::description
