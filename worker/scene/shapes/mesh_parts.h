// Shapes of an OBJ file, one for each of its bsdfs.
#pragma once

#include <vector>

#include "common/description/object.h"
#include "worker/loaders/obj.h"
#include "worker/scene/shapes/shape.h"

namespace candela::scene {

// True if parts of the shape may have different bsdfs, those of the names of their materials.
bool has_bsdfs_by_name(const description::Object& shape);

struct BsdfMesh {
  description::ObjectPtr bsdf;  // null: the shape gives none
  loaders::Mesh mesh;
};
// If several bsdfs fit a material (those without a name, and those of its name), the last one counts. Parts
// are in the order of the file.
std::vector<BsdfMesh> split_by_bsdf(loaders::ObjMesh read, const description::Object& shape);

struct BsdfShape {
  description::ObjectPtr bsdf;
  Shape shape;
};
// The same in world space.
Result<std::vector<BsdfShape>> build_parts(const description::Object& shape,
                                           const description::FileSource& files);

}  // namespace candela::scene
