// A shape of the scene description in world space: a triangle mesh (curves and level sets are meshes, too),
// or a sphere, disk or cylinder, checked and ready to be joined into the scene's geometry.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/description/object.h"
#include "worker/core/vec.h"
#include "worker/loaders/mesh.h"
#include "worker/scene/shapes/quadrics.h"
#include "worker/scene/transform.h"

namespace candela::scene {

// A planar parallelogram: p = corner + s edge_u + t edge_v with s, t in [0, 1]; normal towards its front.
struct Rectangle {
  Vec3 corner, edge_u, edge_v, normal;
};

struct Shape {
  // Triangles, empty for what is not made of them. All triangles have area; corners turn left around the
  // front.
  std::vector<Vec3> positions;
  std::vector<Vec3> normals;  // unit shading normals; empty: flat
  std::vector<Vec2> uvs;      // empty: none
  std::vector<std::array<std::uint32_t, 3>> triangles;
  std::vector<loaders::MeshAttribute> attributes;

  std::optional<Sphere> sphere;
  std::optional<Disk> disk;
  std::optional<Cylinder> cylinder;
  std::optional<Rectangle> rectangle;  // set beside the two triangles of a `rectangle`

  std::uint64_t dropped_count = 0;  // faces without area or with fewer than three corners, left out
};

// Builds a shape from its description. Errors name file and line of the scene or of the mesh. `attributes`:
// the names of those that the shape must have.
Result<Shape> build_shape(const description::Object& object, const description::FileSource& files,
                          const std::vector<std::string>& attributes = {});

// True if to_world makes an ellipse, an ellipsoid or a cylinder over an ellipse of a disk, a sphere or a
// cylinder. build_shape() refuses these; an instance of the round shape is what they are.
bool is_stretched(const description::Object& object);

// A mesh in world space: applies to_world, completes vertex normals (angle-weighted averages of the faces
// around a vertex where the file has none, as Mitsuba does; none at all for face_normals), turns triangles so
// that their geometric front is where the file's vertex normals point (as Mitsuba lets shading normals decide
// sides; a mirror turns nothing inside out), drops faces without area. `name` is for errors.
Result<Shape> shape_from_mesh(loaders::Mesh mesh, const Transform& to_world, bool face_normals,
                              bool flip_normals, const std::string& name);

}  // namespace candela::scene
