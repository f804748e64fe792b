// A triangle mesh as a file holds it, in object space, checked: every index is in range, every number finite.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/description/reading_budget.h"
#include "worker/core/vec.h"

namespace candela::loaders {

// A number or a color that a file gives each vertex or each face.
struct MeshAttribute {
  std::string name;  // as Mitsuba's texture mesh_attribute has it: vertex_color, face_color, ...
  std::vector<Spectrum>
      values;  // one for each position, or one for each triangle; finite; a single number is stored as gray

  bool of_faces() const { return name.starts_with("face_"); }
};

// The attributes that a loader is asked for. A file that lacks one is an error.
struct WantedAttributes {
  std::vector<std::string> names;
  // True if colors are sRGB. If empty, integer values are sRGB and float values are linear, as in Mitsuba 3.
  std::optional<bool> srgb;
};

struct Mesh {
  std::vector<Vec3> positions;
  std::vector<Vec3>
      normals;            // empty, or one for each position; (0, 0, 0) where the file has none for this one
  std::vector<Vec2> uvs;  // empty, or one for each position
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::vector<MeshAttribute> attributes;
  bool face_normals = false;             // the file asks for flat shading
  std::uint64_t dropped_face_count = 0;  // faces of fewer than three corners, left out
};

// The loaders read in parallel, by the calling task arena's threads; the mesh does not depend on their
// number. `origin` is subtracted from positions in double, before they become floats.

// Wavefront OBJ: v, vt, vn and f in all index forms, negative indices too; polygons: polygon.h. Everything
// else (groups, materials, smoothing, lines, curves; colors and w of vertices) is skipped. flip_v: v becomes
// 1 - v. `name` goes into errors, which have a line.
Result<Mesh> load_obj(std::string_view bytes, const std::string& name, bool flip_v, const Vec3d& origin = {});

// Stanford PLY, text and binary of both byte orders: vertices x y z, nx ny nz and u v (or s t, texture_u
// texture_v); faces vertex_indices or vertex_index, polygons: polygon.h; the attributes asked for; other
// properties and elements are skipped. Errors have a line (text) or a byte offset (binary).
Result<Mesh> load_ply(std::string_view bytes, const std::string& name, const WantedAttributes& wanted = {},
                      const Vec3d& origin = {});

// Mitsuba's serialized format, versions 3 and 4, single and double precision. shape_index: which of the
// file's meshes. Memory is bounded by what the compressed bytes can really hold, whatever the file claims,
// and what it claims must fit into the budget. Its only attribute is vertex_color.
Result<Mesh> load_serialized(std::string_view bytes, const std::string& name, std::int64_t shape_index,
                             const WantedAttributes& wanted = {}, const Vec3d& origin = {},
                             description::ReadingBudget& budget = description::ReadingBudget::unlimited());

}  // namespace candela::loaders
