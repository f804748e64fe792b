// Loop's subdivision of triangle meshes.
#pragma once

#include "worker/loaders/mesh.h"

namespace candela::loaders {

// Each level makes four triangles of one; then vertices move to the limit surface. Texture coordinates and
// normals are dropped. The mesh is a manifold, with or without a border; an edge of more than two triangles
// is treated as a border.
Mesh loop_subdivision(Mesh mesh, int levels);

}  // namespace candela::loaders
