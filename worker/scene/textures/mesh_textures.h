// Textures over the triangles that a surface is made of. They hold references into the scene's geometry.
#pragma once

#include <memory>

#include "common/base/result.h"
#include "common/description/object.h"
#include "worker/scene/shapes/geometry.h"
#include "worker/scene/textures/texture.h"

namespace candela::scene {

// A mesh's attribute: Mitsuba 3's `mesh_attribute`. Each shape that it is on has the attribute.
Result<std::unique_ptr<const Texture>> mesh_attribute(const description::Object& object,
                                                      const Geometry& geometry);

// The edges of triangles: 0.6's `wireframe`. A width of 0 is a tenth of the shape's mean edge
// (ShapeRecord::reads_mean_edge).
std::unique_ptr<const Texture> wireframe(const description::Object& object, const ColorTexture& interior,
                                         const ColorTexture& edges, const Geometry& geometry);

}  // namespace candela::scene
