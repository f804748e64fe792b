#include "common/description/pbrt/shapes.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "common/description/check.h"
#include "common/description/pbrt/geometry.h"
#include "common/description/text.h"
#include "common/description/transform.h"

namespace candela::description::pbrt {
namespace {

constexpr std::array<std::string_view, 8> shape_types = {
    "sphere", "disk", "cylinder", "trianglemesh", "plymesh", "bilinearmesh", "loopsubdiv", "curve"};

constexpr std::size_t max_ply_header = 65536;

// True if the first lines of a PLY file tell of normals.
bool ply_has_normals(std::string_view bytes) {
  const std::string_view header =
      bytes.substr(0, std::min<std::size_t>(bytes.find("end_header"), max_ply_header));
  for (const std::string_view name : {" nx\n", " nx\r", " nx "})
    if (header.find(name) != std::string_view::npos) return true;
  return false;
}

// True if the normal points into a whole quadric: pbrt's ReverseOrientation, and a mirror without it.
bool is_inside_out(const ShapeEntity& entity) {
  return entity.reverse_orientation != swaps_handedness(entity.to_world);
}

// A mask without anything.
bool is_hole(const Object& bsdf) {
  return bsdf.plugin == "mask" && bsdf.find("opacity") != nullptr && bsdf.get_number("opacity", 1) <= 0;
}

// True if light goes through the bsdf, or through a part of it.
bool transmits(const ObjectPtr& bsdf) {
  constexpr std::array<std::string_view, 5> kinds = {"null", "dielectric", "roughdielectric",
                                                     "thindielectric", "difftrans"};
  if (std::find(kinds.begin(), kinds.end(), bsdf->plugin) != kinds.end()) return true;
  const std::vector<ObjectPtr> parts = bsdf->children_of("bsdf");
  return std::any_of(parts.begin(), parts.end(), transmits);
}

// The first parameter that the loader would not find: it reads the directive in its own file alone.
const Parameter* given_outside(const ShapeEntity& entity) {
  return entity.parameters.given_outside(
      entity.where.file, {"P",      "N",      "uv",     "st",     "S",     "indices", "faceIndices",
                          "levels", "scheme", "radius", "zmin",   "zmax",  "phimax",  "innerradius",
                          "height", "type",   "basis",  "degree", "width", "width0",  "width1"});
}

}  // namespace

// Makes a grid of triangles from a part of a quadric, or from a stretched quadric.
Result<std::shared_ptr<Object>> Shapes::part_of_quadric(ShapeEntity& entity) {
  context_.differs(entity.where,
                   fmt::format("a part of a {}, or a stretched one, is made of triangles", entity.type));
  return triangles(entity, false, Front::of_quadric);
}

Result<std::shared_ptr<Object>> Shapes::sphere(ShapeEntity& entity) {
  ParameterList& parameters = entity.parameters;
  CANDELA_ASSIGN(const double radius, parameters.number("radius", 1));
  CANDELA_ASSIGN(const double z_min, parameters.number("zmin", -radius));
  CANDELA_ASSIGN(const double z_max, parameters.number("zmax", radius));
  CANDELA_ASSIGN(const double phi_max, parameters.number("phimax", 360));
  const bool whole = std::min(z_min, z_max) <= -radius && std::max(z_min, z_max) >= radius && phi_max >= 360;
  if (!whole || !is_similarity(entity.to_world)) return part_of_quadric(entity);
  std::shared_ptr<Object> shape = make("shape", "sphere", entity.where);
  set(*shape, "radius", radius);
  // pbrt counts v from the bottom, Mitsuba from the top.
  set(*shape, "to_world", transform::multiply(entity.to_world, transform::scale({1, 1, -1})));
  if (is_inside_out(entity)) set_flag(*shape, "flip_normals", true);
  return shape;
}

Result<std::shared_ptr<Object>> Shapes::disk(ShapeEntity& entity) {
  ParameterList& parameters = entity.parameters;
  CANDELA_ASSIGN(const double radius, parameters.number("radius", 1));
  CANDELA_ASSIGN(const double inner, parameters.number("innerradius", 0));
  CANDELA_ASSIGN(const double height, parameters.number("height", 0));
  CANDELA_ASSIGN(const double phi_max, parameters.number("phimax", 360));
  if (inner > 0 || phi_max < 360 || !is_similarity(entity.to_world)) return part_of_quadric(entity);
  std::shared_ptr<Object> shape = make("shape", "disk", entity.where);
  const Mat4 place =
      transform::multiply(transform::translate({0, 0, height}), transform::scale({radius, radius, radius}));
  set(*shape, "to_world", transform::multiply(entity.to_world, place));
  if (is_inside_out(entity)) set_flag(*shape, "flip_normals", true);
  return shape;
}

Result<std::shared_ptr<Object>> Shapes::cylinder(ShapeEntity& entity) {
  ParameterList& parameters = entity.parameters;
  CANDELA_ASSIGN(const double radius, parameters.number("radius", 1));
  CANDELA_ASSIGN(const double z_min, parameters.number("zmin", -1));
  CANDELA_ASSIGN(const double z_max, parameters.number("zmax", 1));
  CANDELA_ASSIGN(const double phi_max, parameters.number("phimax", 360));
  if (phi_max < 360 || !is_similarity(entity.to_world)) return part_of_quadric(entity);
  std::shared_ptr<Object> shape = make("shape", "cylinder", entity.where);
  set(*shape, "radius", radius);
  set_point(*shape, "p0", {0, 0, std::min(z_min, z_max)});
  set_point(*shape, "p1", {0, 0, std::max(z_min, z_max)});
  set(*shape, "to_world", entity.to_world);
  if (is_inside_out(entity)) set_flag(*shape, "flip_normals", true);
  return shape;
}

Result<std::shared_ptr<Object>> Shapes::triangles(ShapeEntity& entity, bool flat, Front front) {
  if (const Parameter* outside = given_outside(entity))
    return error_at(outside->where,
                    fmt::format("parameter {} of the shape at {}:{} stands behind the end of its file",
                                text::quote(outside->name), entity.where.file, entity.where.line))
        .with_mend("write the parameters of a mesh into one file");
  if (entity.has_shared_values)
    return error_at(entity.where,
                    fmt::format("a parameter of shape '{}' given by Attribute is not supported", entity.type))
        .with_mend("write it into the Shape directive");
  std::shared_ptr<Object> shape = make("shape", "pbrtmesh", entity.where);
  set(*shape, "filename", entity.where.file);
  set_integer(*shape, "offset", static_cast<std::int64_t>(entity.offset));
  set(*shape, "to_world", entity.to_world);
  if (flat) set_flag(*shape, "face_normals", true);
  // A mirror keeps the front of a mesh, as in pbrt, whether normals or the order of corners decide it; it
  // turns a quadric's around in pbrt.
  if (entity.reverse_orientation != (front == Front::of_quadric && swaps_handedness(entity.to_world)))
    set_flag(*shape, "flip_normals", true);
  entity.parameters.ignore({"P", "N", "uv", "st", "S", "indices", "faceIndices", "emissionfilename", "levels",
                            "scheme", "edgelength", "radius", "zmin", "zmax", "phimax", "innerradius",
                            "height"});
  return shape;
}

bool ShapeEntity::joins(const ShapeEntity& other) const {
  const auto is_plain_curve = [](const ShapeEntity& entity) {
    return entity.type == "curve" && !entity.has_shared_values && given_outside(entity) == nullptr &&
           entity.parameters.is_only(
               {"P", "N", "type", "basis", "degree", "width", "width0", "width1", "splitdepth"});
  };
  return is_plain_curve(*this) && is_plain_curve(other) && where.file == other.where.file;
}

Result<std::shared_ptr<Object>> Shapes::curve(ShapeEntity& entity) {
  constexpr std::array<std::string_view, 3> types = {"flat", "cylinder", "ribbon"};
  CANDELA_ASSIGN(const std::string type, entity.parameters.text("type", "flat"));
  if (std::find(types.begin(), types.end(), type) == types.end())
    return Context::unknown(entity.where, "type of curve", type, types);
  context_.differs(entity.where,
                   type == "cylinder"
                       ? "curves are tubes: meshes of up to 16 sides with smooth normals"
                       : fmt::format("curves of the type '{}' are tubes, as wide and as thick", type));
  entity.parameters.ignore({"N", "basis", "degree", "width", "width0", "width1", "splitdepth"});
  CANDELA_ASSIGN(std::shared_ptr<Object> shape, triangles(entity, false, Front::of_quadric));
  set_integer(*shape, "curves", entity.curve_count);
  return shape;
}

Result<std::shared_ptr<Object>> Shapes::ply(ShapeEntity& entity) {
  CANDELA_ASSIGN(const std::string name, entity.parameters.text("filename", ""));
  CANDELA_ASSIGN(const std::string key, context_.find_file(entity.where, name));
  CANDELA_ASSIGN(const FileSource::Bytes bytes, context_.start(key, max_ply_header));
  if (entity.parameters.has("displacement")) {
    context_.differs(entity.where,
                     "the displacement of a mesh is passed over: its triangles stay where they are");
    entity.parameters.ignore({"displacement", "displacement.edgelength", "uvscale"});
  }
  entity.parameters.ignore({"edgelength"});
  std::shared_ptr<Object> shape = make("shape", "ply", entity.where);
  set(*shape, "filename", key);
  set(*shape, "to_world", entity.to_world);
  if (!ply_has_normals(bytes.view)) set_flag(*shape, "face_normals", true);
  if (entity.reverse_orientation) set_flag(*shape, "flip_normals", true);
  return shape;
}

Result<std::shared_ptr<Object>> Shapes::geometry(ShapeEntity& entity) {
  if (entity.type == "sphere") return sphere(entity);
  if (entity.type == "disk") return disk(entity);
  if (entity.type == "cylinder") return cylinder(entity);
  if (entity.type == "plymesh") return ply(entity);
  if (entity.type == "trianglemesh") {
    return triangles(entity, !entity.parameters.has("N"), Front::of_mesh);
  }
  if (entity.type == "curve") return curve(entity);
  if (entity.type == "bilinearmesh") return triangles(entity, false, Front::of_mesh);
  if (entity.type == "loopsubdiv") return triangles(entity, false, Front::of_mesh);
  CANDELA_TRY(
      context_.refuse(Context::unknown(entity.where, "shape", entity.type, shape_types), "it is left out"));
  return std::shared_ptr<Object>();
}

Result<ObjectPtr> Shapes::masked(ShapeEntity& entity, ObjectPtr bsdf) {
  CANDELA_ASSIGN(const std::optional<Value> alpha, textures_.optional_number(entity.parameters, "alpha"));
  if (!alpha || (alpha->is_constant() && alpha->number() >= 1)) return bsdf;
  const double constant = alpha->is_constant() ? alpha->number() : 1;
  ObjectPtr& mask = masks_[{bsdf.get(), {alpha->texture.get(), constant}}];
  if (mask) return mask;
  std::shared_ptr<Object> object = make("bsdf", "mask", entity.where);
  set_number(*object, "opacity", *alpha);
  add(*object, "", std::move(bsdf));
  CANDELA_ASSIGN(mask, context_.finish(std::move(object)));
  return mask;
}

Result<void> Shapes::add_media(const ShapeEntity& entity, Object& shape, const ObjectPtr& interior) {
  // Each name is kept once.
  const bool bounds_media = entity.inside != entity.outside || interior;
  if (!bounds_media) return {};
  if (const Object& bsdf = *shape.children.at(0).object; bsdf.plugin == "mask") {
    // Light through a hole stays in its medium in pbrt. Nothing else crosses an opaque surface.
    if (!transmits(bsdf.children_of("bsdf").at(0))) {
      context_.differs(
          entity.where,
          "light that the inner side of a shape of an alpha below 1 reflects stays in the medium "
          "that it came through, where pbrt has it go on in the medium inside");
      return {};
    }
    context_.differs(
        entity.where,
        "light that passes the holes of a shape of an alpha below 1 enters the medium behind, where "
        "in pbrt it stays in its own");
  }
  const auto medium = [&](const std::shared_ptr<const std::string>& name) {
    return name != nullptr ? media_.medium(*name, entity.where) : Result<ObjectPtr>(ObjectPtr());
  };
  CANDELA_ASSIGN(ObjectPtr inside, medium(entity.inside));
  CANDELA_ASSIGN(ObjectPtr outside, medium(entity.outside));
  if (interior) inside = interior;
  if (inside) add(shape, "interior", std::move(inside));
  if (outside) add(shape, "exterior", std::move(outside));
  return {};
}

Result<ObjectPtr> Shapes::build(ShapeEntity& entity) {
  if (!transform::is_finite(entity.to_world) || !transform::is_invertible(entity.to_world))
    return error_at(entity.where, "the transform of the shape is singular");
  CANDELA_ASSIGN(std::shared_ptr<Object> shape, geometry(entity));
  if (shape == nullptr) return ObjectPtr();
  CANDELA_ASSIGN(Surface surface,
                 materials_.surface(entity.material != nullptr ? *entity.material : MaterialName()));
  const bool interface = surface.bsdf->plugin == "null";
  CANDELA_ASSIGN(ObjectPtr bsdf, masked(entity, std::move(surface.bsdf)));
  if (is_hole(*bsdf) && !entity.emitter) {
    CANDELA_TRY(context_.refuse_unused(entity.parameters, fmt::format("shape '{}'", entity.type)));
    return ObjectPtr();
  }
  add(*shape, "", std::move(bsdf));
  CANDELA_TRY(add_media(entity, *shape, surface.interior));
  if (entity.emitter && interface)
    context_.differs(entity.where, "a shape of the material 'interface' does not glow, as in pbrt");
  if (entity.emitter && shape->children.at(0).object->plugin == "mask")
    context_.differs(entity.where, "a lamp of an alpha below 1 glows and is seen as if its alpha were 1");
  const bool is_mesh = shape->plugin == "pbrtmesh" || shape->plugin == "ply";
  if (entity.emitter && is_mesh && entity.emitter->find("power") != nullptr)
    context_.differs(entity.where,
                     "the power of an area light is the whole shape's, where pbrt gives it to each triangle");
  if (entity.emitter && !interface) add(*shape, "", entity.emitter);
  CANDELA_TRY(context_.refuse_unused(entity.parameters, fmt::format("shape '{}'", entity.type)));
  return context_.finish(std::move(shape));
}

}  // namespace candela::description::pbrt
