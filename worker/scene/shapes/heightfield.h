// A grid of heights over a square, as a mesh: Mitsuba 0.6's heightfield.
#pragma once

#include "common/base/result.h"
#include "common/description/object.h"
#include "worker/scene/shapes/shape.h"
#include "worker/scene/textures/texture.h"

namespace candela::scene {

// The vertices are the pixels of an image, or of the shape's texture at its own or the asked resolution; the
// first row is at y = -1. A cell between four vertices is two triangles that meet along its diagonal from
// (0, 0). Normals are those of Mitsuba 0.6.
Result<Shape> build_heightfield(const description::Object& object, const description::FileSource& files,
                                TextureStore& textures);

}  // namespace candela::scene
