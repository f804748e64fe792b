// Tells if a scene has color.
#pragma once

#include "common/description/object.h"

namespace candela::description {

// True if a spectrum of the scene is not gray, or if the scene has what may not be: a picture, a grid of
// three channels, a material or a sky whose colors are measured. Visits each object once, however many refer
// to it.
bool has_color(const Object& scene);

}  // namespace candela::description
