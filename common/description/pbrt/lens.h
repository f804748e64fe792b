// The lenses of pbrt's camera 'realistic', reduced to one thin lens.
#pragma once

#include "common/description/pbrt/camera.h"
#include "common/description/pbrt/context.h"

namespace candela::description::pbrt {

// All lengths in units of the scene, which are meters to pbrt.
struct ThinLens {
  double radius = 0;          // of the entrance pupil
  double image_distance = 0;  // from the lens to the film, where what is in focus is sharp
  double focus_distance = 0;
};

// Traces a paraxial ray through the surfaces of `lensfile`. Errors: the file is damaged, the lenses do not
// gather light, or what is in focus is nearer than the focal length.
Result<ThinLens> realistic_lens(Context& context, Entity& camera);

}  // namespace candela::description::pbrt
