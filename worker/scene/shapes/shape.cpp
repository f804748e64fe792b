// From a shape element to geometry: rectangle, cube, sphere, obj, serialized.
#include "worker/scene/shapes/shape.h"

#include <cmath>

namespace candela::scene {
namespace {

Error error_at(const description::Object& object, std::string message) {
  return input_error("shape '" + object.plugin + "': " + std::move(message))
      .at(object.where.file, object.where.line);
}

// The corners of [-1, 1]^2 at z = 0, front towards +z; uv = (x + 1, y + 1) / 2.
loaders::Mesh unit_rectangle() {
  loaders::Mesh mesh;
  mesh.positions = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}};
  mesh.normals.assign(4, {0, 0, 1});
  mesh.uvs = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

// [-1, 1]^3, each face mapped onto [0, 1]^2 as Mitsuba's cube maps it: a face is named by its four corners,
// whose uv are (0, 1), (1, 1), (1, 0), (0, 0) in turn.
loaders::Mesh unit_cube() {
  struct Face {
    Vec3 normal;
    std::array<Vec3, 4> corners;
  };
  static constexpr std::array<Face, 6> kFaces = {{
      {{0, -1, 0}, {{{1, -1, -1}, {1, -1, 1}, {-1, -1, 1}, {-1, -1, -1}}}},
      {{0, 1, 0}, {{{1, 1, -1}, {-1, 1, -1}, {-1, 1, 1}, {1, 1, 1}}}},
      {{1, 0, 0}, {{{1, -1, -1}, {1, 1, -1}, {1, 1, 1}, {1, -1, 1}}}},
      {{0, 0, 1}, {{{1, -1, 1}, {1, 1, 1}, {-1, 1, 1}, {-1, -1, 1}}}},
      {{-1, 0, 0}, {{{-1, -1, 1}, {-1, 1, 1}, {-1, 1, -1}, {-1, -1, -1}}}},
      {{0, 0, -1}, {{{1, 1, -1}, {1, -1, -1}, {-1, -1, -1}, {-1, 1, -1}}}},
  }};
  static constexpr std::array<Vec2, 4> kUv = {{{0, 1}, {1, 1}, {1, 0}, {0, 0}}};
  loaders::Mesh mesh;
  for (const Face& face : kFaces) {
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    for (std::size_t k = 0; k < 4; ++k) {
      mesh.positions.push_back(face.corners[k]);
      mesh.normals.push_back(face.normal);
      mesh.uvs.push_back(kUv[k]);
    }
    mesh.triangles.push_back({first, first + 1, first + 2});
    mesh.triangles.push_back({first + 3, first, first + 2});
  }
  return mesh;
}

// Planar faces whose vertex normals only said which side is the front.
Result<Shape> flat_shape(const description::Object& object, loaders::Mesh mesh, const Transform& to_world) {
  CANDELA_ASSIGN(Shape shape, shape_from_mesh(std::move(mesh), to_world, false,
                                              object.get_bool("flip_normals", false), object.where.file));
  if (shape.dropped_count > 0) return error_at(object, "to_world leaves it without area");
  shape.normals.clear();
  return shape;
}

Result<Shape> build_rectangle(const description::Object& object, const Transform& to_world) {
  CANDELA_ASSIGN(Shape shape, flat_shape(object, unit_rectangle(), to_world));
  const Vec3 corner = shape.positions[0];
  const Vec3 u = shape.positions[1] - corner, v = shape.positions[3] - corner;
  Vec3 n = Vec3(normalize(cross(Vec3d(u), Vec3d(v))));
  const auto& t = shape.triangles[0];
  const Vec3d front = cross(Vec3d(shape.positions[t[1]]) - Vec3d(shape.positions[t[0]]),
                            Vec3d(shape.positions[t[2]]) - Vec3d(shape.positions[t[0]]));
  if (dot(front, Vec3d(n)) < 0) n = -n;
  shape.rectangle = Rectangle{corner, u, v, n};
  return shape;
}

Result<Shape> build_sphere(const description::Object& object, const Transform& to_world) {
  const description::Vec3 center = object.get_vec3("center", {0, 0, 0});
  const double radius = object.get_number("radius", 1.0);
  if (!(radius > 0)) {
    return error_at(object, "radius must be above 0, not " + std::to_string(radius))
        .with_field("radius")
        .with_mend("turn a sphere inside out with flip_normals");
  }
  if (!to_world.is_similarity()) {
    return error_at(object, "to_world scales unevenly or shears, which would make it an ellipsoid")
        .with_field("to_world")
        .with_mend("scale all axes alike, or use a mesh");
  }
  const double scale = length(to_world.column(0));
  Sphere sphere;
  sphere.center = to_world.point({center[0], center[1], center[2]});
  sphere.radius = radius * scale;
  sphere.inside_out = object.get_bool("flip_normals", false);
  for (int i = 0; i < 3; ++i) sphere.axes[static_cast<std::size_t>(i)] = normalize(to_world.column(i));
  const double reach =
      std::max({std::abs(sphere.center.x), std::abs(sphere.center.y), std::abs(sphere.center.z)});
  if (!(reach + sphere.radius <= 1e18) || !(sphere.radius > 1e-30)) {
    return error_at(object, "its radius or place in the scene is out of range (coordinates up to 1e18)");
  }
  Shape shape;
  shape.sphere = sphere;
  return shape;
}

Result<Shape> build_from_file(const description::Object& object, const description::FileSource& files,
                              const Transform& to_world) {
  const std::string file = object.get_string("filename", "");
  if (file.empty()) return error_at(object, "filename is missing").with_field("filename");
  CANDELA_ASSIGN(const description::FileSource::Bytes bytes, files.open(file));
  loaders::Mesh mesh;
  if (object.plugin == "obj") {
    CANDELA_ASSIGN(mesh, loaders::load_obj(bytes.view, file, object.get_bool("flip_tex_coords", true)));
  } else {
    CANDELA_ASSIGN(mesh, loaders::load_serialized(bytes.view, file, object.get_integer("shape_index", 0)));
    if (object.get_bool("flip_tex_coords", false)) {
      for (Vec2& uv : mesh.uvs) uv.y = 1 - uv.y;
    }
  }
  return shape_from_mesh(std::move(mesh), to_world, object.get_bool("face_normals", false),
                         object.get_bool("flip_normals", false), file);
}

}  // namespace

Result<Shape> build_shape(const description::Object& object, const description::FileSource& files) {
  const Transform to_world(object.get_transform("to_world"));
  if (object.plugin == "rectangle") return build_rectangle(object, to_world);
  if (object.plugin == "cube") return flat_shape(object, unit_cube(), to_world);
  if (object.plugin == "sphere") return build_sphere(object, to_world);
  if (object.plugin == "obj" || object.plugin == "serialized")
    return build_from_file(object, files, to_world);
  return error_at(object, "this renderer cannot build it yet");
}

}  // namespace candela::scene
