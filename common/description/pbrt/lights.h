// pbrt's lights.
#pragma once

#include <string>

#include "common/description/pbrt/context.h"
#include "common/description/pbrt/spectra.h"
#include "common/description/pbrt/textures.h"

namespace candela::description::pbrt {

struct LightEntity {
  std::string type;
  ParameterList parameters;
  Location where;
  Mat4 to_world{};
  ColorSpace space = ColorSpace::srgb;
  ObjectPtr medium;   // around it; may be null
  double factor = 1;  // the film's exposure
};

// LightSource. Null: it is left out.
Result<ObjectPtr> build_light(Context& context, Textures& textures, LightEntity& entity);

// AreaLightSource: the emitter of the shapes that follow it.
Result<ObjectPtr> build_area_light(Context& context, Textures& textures, LightEntity& entity);

}  // namespace candela::description::pbrt
