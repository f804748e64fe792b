// Curves as Mitsuba 3's text files hold them: one control point a line, x y z radius; empty lines between
// curves.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "worker/core/vec.h"

namespace candela::loaders {

struct ControlPoint {
  Vec3d p;
  double radius = 0;  // not negative
};

using Curve = std::vector<ControlPoint>;

// Every number is finite. `min_points`: a curve of fewer control points is an error. Errors have a line.
Result<std::vector<Curve>> load_curves(std::string_view bytes, const std::string& name,
                                       std::size_t min_points);

}  // namespace candela::loaders
