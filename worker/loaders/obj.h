// Wavefront OBJ files with their parts; load_obj() in mesh.h reads a file as one mesh.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "worker/loaders/mesh.h"

namespace candela::loaders {

struct ObjOptions {
  bool flip_v = false;  // v becomes 1 - v
  // If not, a part begins at each g and usemtl that follows a face, as in Mitsuba 0.6. Parts share no vertex
  // whose normal is not given, so that normals are smooth within a part.
  bool collapse = true;
  // One part alone; parts begin at each o then, too.
  std::optional<std::uint64_t> shape_index = {};
  Vec3d origin = {};  // subtracted from positions in double
};

// Triangles of one material that follow each other.
struct MeshPart {
  std::string material = {};       // of usemtl; empty: none
  std::size_t first_triangle = 0;  // up to the next part's
};

struct ObjMesh {
  Mesh mesh;
  std::vector<MeshPart> parts;  // one at least, unless the options collapse the file
};

Result<ObjMesh> load_obj_parts(std::string_view bytes, const std::string& name, const ObjOptions& options);

}  // namespace candela::loaders
