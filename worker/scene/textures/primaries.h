// Colors of other primaries than Rec.709's.
#pragma once

#include <array>
#include <optional>

#include "worker/core/vec.h"

namespace candela::scene {

// Rows of the matrix to linear Rec.709 from colors whose red, green, blue and white have these x and y, as
// OpenEXR's attribute `chromaticities` has them. Luminance is kept, white is not adapted, as in OpenEXR and
// Mitsuba. Nothing: they are Rec.709's, or make no colors.
std::optional<std::array<Vec3d, 3>> to_rec709(const std::array<float, 8>& chromaticities);

}  // namespace candela::scene
