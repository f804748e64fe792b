// From a shape element to geometry.
#include "worker/scene/shapes/shape.h"

#include <cmath>

#include "worker/loaders/curves.h"
#include "worker/loaders/pbrt_curve.h"
#include "worker/loaders/pbrt_mesh.h"
#include "worker/loaders/volume.h"
#include "worker/scene/shapes/creases.h"
#include "worker/scene/shapes/level_set.h"
#include "worker/scene/shapes/mesh_parts.h"
#include "worker/scene/shapes/tube.h"

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
  Result<Shape> made = shape_from_mesh(std::move(mesh), to_world, false,
                                       object.get_bool("flip_normals", false), object.where.file);
  if (!made.ok()) return error_at(object, made.error().message).with_field("to_world");
  Shape shape = std::move(*made);
  if (shape.triangles.empty())
    return error_at(object, "no face of the mesh has an area").with_field("to_world");
  if (shape.dropped_count > 0)
    return error_at(object, "to_world leaves it without area").with_field("to_world");
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

// Checks that rays can be traced: squares of coordinates stay finite in float, those of sizes above zero.
Result<void> check_range(const description::Object& object, const Bounds& bounds, double least_size) {
  for (const Vec3d p : {bounds.low, bounds.high}) {
    if (!(std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) <= 1e18) || !(least_size > 1e-30)) {
      return error_at(object, "its size or place in the scene is out of range (coordinates up to 1e18)");
    }
  }
  return {};
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
        .with_mend("only a shape that neither glows nor measures may be stretched; use a mesh");
  }
  const double scale = length(to_world.column(0));
  Sphere sphere;
  sphere.center = to_world.point({center[0], center[1], center[2]});
  sphere.radius = radius * scale;
  sphere.inside_out = object.get_bool("flip_normals", false);
  for (int i = 0; i < 3; ++i) sphere.axes[static_cast<std::size_t>(i)] = normalize(to_world.column(i));
  CANDELA_TRY(check_range(object, bounds_of(sphere), sphere.radius));
  Shape shape;
  shape.sphere = sphere;
  return shape;
}

// True if both have one length and are at right angles, to the tolerance of Transform::is_similarity.
bool is_circle(Vec3d a, Vec3d b) {
  const double la = length(a), lb = length(b);
  return std::abs(la - lb) <= 1e-4 * la && std::abs(dot(a, b)) <= 1e-4 * la * lb;
}

// The angle around a cylinder is measured in Mitsuba's basis [Duff et al. 2017], taken along by to_world.
std::array<Vec3d, 3> cylinder_axes(Vec3d axis, const Transform& to_world) {
  const Vec3d n = normalize(axis);
  const double sign = std::copysign(1.0, n.z), a = -1 / (sign + n.z), b = n.x * n.y * a;
  return {to_world.vector({1 + sign * n.x * n.x * a, sign * b, -sign * n.x}),
          to_world.vector({b, sign + n.y * n.y * a, -n.y}), to_world.vector(axis)};
}

bool is_round(Vec3d u, Vec3d v, Vec3d along) {
  const double slack = 1e-4 * length(u) * length(along);
  return is_circle(u, v) && std::abs(dot(u, along)) <= slack && std::abs(dot(v, along)) <= slack;
}

Vec3d cylinder_axis(const description::Object& object) {
  const description::Vec3 p0 = object.get_vec3("p0", {0, 0, 0}), p1 = object.get_vec3("p1", {0, 0, 1});
  return Vec3d{p1[0], p1[1], p1[2]} - Vec3d{p0[0], p0[1], p0[2]};
}

Result<Shape> build_disk(const description::Object& object, const Transform& to_world) {
  const Vec3d u = to_world.column(0), v = to_world.column(1);
  if (!is_circle(u, v)) {
    return error_at(object, "to_world scales unevenly or shears, which would make it an ellipse")
        .with_field("to_world")
        .with_mend("only a shape that neither glows nor measures may be stretched; use a mesh");
  }
  Disk disk;
  disk.center = to_world.translation();
  disk.radius = length(u);
  Vec3d n = to_world.normal({0, 0, 1});
  // A depth squeezed to nothing leaves a disk all the same, but no side that the matrix calls its front.
  if (!(length(n) > 0) || to_world.determinant() == 0) {
    return error_at(object, "to_world is singular").with_field("to_world");
  }
  if (object.get_bool("flip_normals", false)) n = -n;
  disk.axes[2] = normalize(n);
  disk.axes[0] = normalize(u);
  disk.axes[1] = cross(disk.axes[2], disk.axes[0]);
  if (dot(disk.axes[1], v) < 0) disk.axes[1] = -disk.axes[1];
  CANDELA_TRY(check_range(object, bounds_of(disk), disk.radius));
  Shape shape;
  shape.disk = disk;
  return shape;
}

Result<Shape> build_cylinder(const description::Object& object, const Transform& to_world) {
  const description::Vec3 p0 = object.get_vec3("p0", {0, 0, 0});
  const double radius = object.get_number("radius", 1.0);
  if (!(radius > 0)) {
    return error_at(object, "radius must be above 0, not " + std::to_string(radius)).with_field("radius");
  }
  const Vec3d base{p0[0], p0[1], p0[2]}, axis = cylinder_axis(object);
  if (!(length(axis) > 0)) return error_at(object, "p0 and p1 are the same point").with_field("p1");
  const auto [u, v, along] = cylinder_axes(axis, to_world);
  if (!is_round(u, v, along)) {
    return error_at(object,
                    "to_world scales unevenly across the axis or shears, which would make it no "
                    "circular cylinder")
        .with_field("to_world")
        .with_mend("only a shape that neither glows nor measures may be stretched; use a mesh");
  }
  Cylinder cylinder;
  cylinder.base = to_world.point(base);
  cylinder.radius = radius * length(u);
  cylinder.length = length(along);
  cylinder.inside_out = object.get_bool("flip_normals", false);
  cylinder.axes[2] = normalize(along);
  cylinder.axes[0] = normalize(u - cylinder.axes[2] * dot(u, cylinder.axes[2]));
  cylinder.axes[1] = cross(cylinder.axes[2], cylinder.axes[0]);
  if (dot(cylinder.axes[1], v) < 0) cylinder.axes[1] = -cylinder.axes[1];
  CANDELA_TRY(check_range(object, bounds_of(cylinder), std::min(cylinder.radius, cylinder.length)));
  Shape shape;
  shape.cylinder = cylinder;
  return shape;
}

// Errors of the mesh get the place of the shape.
Result<loaders::Mesh> at_shape(const description::Object& object, Result<loaders::Mesh> mesh) {
  if (mesh.ok()) return mesh;
  return std::move(mesh).error().at(object.where.file, object.where.line);
}

Error lacks_attribute(const description::Object& object, const std::string& name) {
  return error_at(object, "it has no attribute '" + name + "'")
      .with_mend("meshes of ply and serialized files have attributes");
}

loaders::ObjOptions obj_options(const description::Object& object) {
  loaders::ObjOptions options;
  options.flip_v = object.get_bool("flip_tex_coords", true);
  options.collapse = object.get_bool("collapse", true);
  const std::int64_t index = object.get_integer("shape_index", -1);
  if (index >= 0) options.shape_index = static_cast<std::uint64_t>(index);
  return options;
}

bool is_faceted(const description::Object& object) {
  return object.get_bool("face_normals", false);
}

// Only OBJ files have parts.
Result<loaders::ObjMesh> mesh_of_file(const description::Object& object, const description::FileSource& files,
                                      const Transform& to_world, const std::vector<std::string>& attributes) {
  const std::string file = object.get_string("filename", "");
  if (file.empty()) return error_at(object, "filename is missing").with_field("filename");
  CANDELA_ASSIGN(const description::FileSource::Bytes bytes, files.open(file));
  description::ReadingBudget& budget = files.budget();
  // The other files' loaders count what they make.
  description::Charge charge(budget);
  if (object.plugin != "pbrtmesh" && object.plugin != "serialized")
    CANDELA_TRY(charge.add(bytes.view.size(), object.where, "the mesh of '" + file + "'"));
  loaders::ObjMesh read;
  loaders::Mesh& mesh = read.mesh;
  // The origin of a scene that was moved (placement.h).
  const description::Vec3 at = object.get_vec3("origin", {0, 0, 0});
  const Vec3d origin{at[0], at[1], at[2]};
  loaders::WantedAttributes wanted{attributes, std::nullopt};
  if (object.find("srgb") != nullptr) wanted.srgb = object.get_bool("srgb", true);
  if (!attributes.empty() && object.plugin != "ply" && object.plugin != "serialized")
    return lacks_attribute(object, attributes[0]);
  if (object.plugin == "bsplinecurve") {
    CANDELA_ASSIGN(const auto curves, loaders::load_curves(bytes.view, file, 4));
    CANDELA_ASSIGN(mesh, at_shape(object, bspline_tubes(curves)));
  } else if (object.plugin == "linearcurve") {
    CANDELA_ASSIGN(const auto curves, loaders::load_curves(bytes.view, file, 2));
    CANDELA_ASSIGN(mesh, at_shape(object, linear_tubes(curves)));
  } else if (object.plugin == "sdfgrid") {
    CANDELA_ASSIGN(const auto field, loaders::load_volume(bytes.view, file, true));
    CANDELA_ASSIGN(mesh, level_set(field, file));
  } else if (object.plugin == "obj") {
    loaders::ObjOptions options = obj_options(object);
    options.origin = origin;
    CANDELA_ASSIGN(read, loaders::load_obj_parts(bytes.view, file, options));
  } else if (object.plugin == "ply") {
    CANDELA_ASSIGN(mesh, loaders::load_ply(bytes.view, file, wanted, origin));
    if (object.get_bool("flip_tex_coords", false)) {
      for (Vec2& uv : mesh.uvs) uv.y = 1 - uv.y;
    }
  } else if (object.plugin == "pbrtmesh") {
    const std::int64_t offset = object.get_integer("offset", 0), curves = object.get_integer("curves", 0);
    const int line = object.where.file == file ? object.where.line : 1;
    if (curves > 0) {
      CANDELA_ASSIGN(const auto pieces, loaders::load_pbrt_curves(bytes.view, file, offset, line, curves,
                                                                  loaders::kMaxCubicPieces, budget));
      CANDELA_ASSIGN(mesh, at_shape(object, piecewise_tubes(pieces)));
    } else {
      CANDELA_ASSIGN(mesh, loaders::load_pbrt_shape(bytes.view, file, offset, line, origin, budget));
    }
  } else {
    CANDELA_ASSIGN(mesh, loaders::load_serialized(bytes.view, file, object.get_integer("shape_index", 0),
                                                  wanted, origin, budget));
    if (object.get_bool("flip_tex_coords", false)) {
      for (Vec2& uv : mesh.uvs) uv.y = 1 - uv.y;
    }
  }
  if (object.find("max_smooth_angle") != nullptr && !is_faceted(object)) {
    mesh = split_at_creases(std::move(mesh), to_world, object.get_number("max_smooth_angle", 0), read.parts);
  }
  return read;
}

Result<Shape> shape_of_file(const description::Object& object, loaders::Mesh mesh,
                            const Transform& to_world) {
  return shape_from_mesh(std::move(mesh), to_world, is_faceted(object),
                         object.get_bool("flip_normals", false), object.get_string("filename", ""));
}

}  // namespace

bool is_stretched(const description::Object& object) {
  const Transform to_world(object.get_transform("to_world"));
  if (object.plugin == "sphere") return !to_world.is_similarity();
  if (object.plugin == "disk") return !is_circle(to_world.column(0), to_world.column(1));
  if (object.plugin != "cylinder" || !(length(cylinder_axis(object)) > 0)) return false;
  const auto [u, v, along] = cylinder_axes(cylinder_axis(object), to_world);
  return !is_round(u, v, along);
}

Result<Shape> build_shape(const description::Object& object, const description::FileSource& files,
                          const std::vector<std::string>& attributes) {
  const Transform to_world(object.get_transform("to_world"));
  if (object.find("filename") != nullptr) {
    CANDELA_ASSIGN(loaders::ObjMesh read, mesh_of_file(object, files, to_world, attributes));
    return shape_of_file(object, std::move(read.mesh), to_world);
  }
  if (!attributes.empty()) return lacks_attribute(object, attributes[0]);
  if (object.plugin == "rectangle") return build_rectangle(object, to_world);
  if (object.plugin == "cube") return flat_shape(object, unit_cube(), to_world);
  if (object.plugin == "sphere") return build_sphere(object, to_world);
  if (object.plugin == "disk") return build_disk(object, to_world);
  if (object.plugin == "cylinder") return build_cylinder(object, to_world);
  return error_at(object, "this renderer cannot build it yet");
}

Result<std::vector<BsdfShape>> build_parts(const description::Object& object,
                                           const description::FileSource& files) {
  const Transform to_world(object.get_transform("to_world"));
  CANDELA_ASSIGN(loaders::ObjMesh read, mesh_of_file(object, files, to_world, {}));
  std::vector<BsdfShape> out;
  for (BsdfMesh& part : split_by_bsdf(std::move(read), object)) {
    CANDELA_ASSIGN(Shape shape, shape_of_file(object, std::move(part.mesh), to_world));
    out.push_back({std::move(part.bsdf), std::move(shape)});
  }
  return out;
}

}  // namespace candela::scene
