// The field of view of cameras, and of what projects as they see.
#pragma once

#include "common/base/result.h"
#include "common/description/object.h"

namespace candela::scene {

// Half the picture's width at unit depth, by the parameters fov and fov_axis, or focal_length. `aspect`: the
// picture's width over its height. Errors name file, line and parameter.
Result<double> half_width_at_unit_depth(const description::Object& object, double aspect);

}  // namespace candela::scene
