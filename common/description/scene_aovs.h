// Reads the elements around a scene's integrator: `aov` (Mitsuba's) and `lpe` (ours) add layers, `edits`
// (ours) edits light transport.
#pragma once

#include <string>
#include <string_view>
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

// The value of the parameter `edits` of an integrator `edits`, as parse_edits() of common/edits/edits.h reads
// it.
Result<std::string> read_scene_edits(const Property& edits);
// A read scene has that text in a property of this name.
inline constexpr std::string_view kEditsOfScene = "edits";

// Requests of a scene's integrators, as the functions above return them.
struct SceneRequests {
  std::string aovs, layers, edits;
};
// Adds what an integrator `aov`, `lpe` or `edits` asks for, unless there is such a request already. Fails
// (input) on a bad one, and on an `lpe` or `edits` of other parameters.
Result<void> add_requests(const Object& integrator, bool lenient, std::vector<Note>& passed_over,
                          SceneRequests& requests);

// True if the element makes layers or edits and leaves the image to the integrator inside the element.
bool is_layer_element(std::string_view plugin);

}  // namespace candela::description
