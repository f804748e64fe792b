// The sky and the sun as a latitude-longitude image: Mitsuba 0.6's `sky`, `sun` and `sunsky`. The sky is that
// of sky_model.h, the sun that of Preetham et al. [1999]. +y is up. Radiance is in W / (m^2 sr nm), the mean
// over wavelengths as the eye weighs them, as 0.6's is.
#pragma once

#include "common/base/result.h"
#include "common/description/object.h"
#include "worker/scene/textures/scratch.h"
#include "worker/scene/textures/texel_image.h"

namespace candela::scene {

bool is_daylight(const description::Object& emitter);

// The image of an emitter for which is_daylight() holds.
Result<TexelImage> daylight_image(const description::Object& emitter, Scratch& scratch);

}  // namespace candela::scene
