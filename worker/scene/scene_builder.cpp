// From a description to the parts of a compiled scene.
#include "worker/scene/scene_builder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <type_traits>
#include <utility>

#include "common/base/log.h"
#include "common/base/work_monitor.h"
#include "worker/scene/emitters/emitter_build.h"
#include "worker/scene/shapes/geometry_steps.h"
#include "worker/scene/shapes/heightfield.h"
#include "worker/scene/shapes/mesh_parts.h"
#include "worker/scene/transform.h"

namespace candela::scene {
namespace {

constexpr std::uint64_t kMaxPrimitives = 0xfffffff0u;  // Embree's ids are 32-bit

Error error_at(const description::Object& object, std::string message) {
  return input_error(std::move(message)).at(object.where.file, object.where.line);
}

constexpr std::uint64_t kLightBytes = sizeof(Emitter) + 256;  // with its bounds, and nodes of the light tree
constexpr std::uint64_t kMapEntryBytes = 64;                  // beside the value

std::uint64_t memory_of(const Shape& shape) {
  std::uint64_t bytes = shape.positions.size() * sizeof(Vec3) + shape.normals.size() * sizeof(Vec3) +
                        shape.uvs.size() * sizeof(Vec2) +
                        shape.triangles.size() * (sizeof(shape.triangles[0]) + sizeof(Triangle));
  for (const loaders::MeshAttribute& attribute : shape.attributes)
    bytes += attribute.values.size() * sizeof(Spectrum);
  return bytes + (shape.sphere ? sizeof(SphereRecord) : 0) + (shape.disk ? sizeof(DiskRecord) : 0) +
         (shape.cylinder ? sizeof(CylinderRecord) : 0);
}

// A mesh of which no face has an area.
bool is_empty(const Shape& shape) {
  return shape.triangles.empty() && !shape.sphere && !shape.disk && !shape.cylinder;
}

}  // namespace

SceneBuilder::TextureUse SceneBuilder::texture_use(const description::Object& object) {
  const bool is_texture = object.category == "texture", is_shape = object.category == "shape";
  TextureUse use;
  use.uv = is_texture;
  for (const char* name : {"alpha_u", "alpha_v", "anisotropic"}) use.uv |= object.find(name) != nullptr;
  use.wireframe = is_texture && object.plugin == "wireframe";
  use.place =
      use.wireframe || (is_texture && (object.plugin == "mesh_attribute" || object.plugin == "volume"));
  if (is_texture && object.plugin == "mesh_attribute")
    use.attributes.push_back(object.get_string("name", ""));
  for (const description::Child& child : object.children) {
    if (child.object->category == "shape") continue;
    const TextureUse& below = texture_use_of_part(*child.object);
    // A texture that made a shape is not looked at by its hits.
    use.uv |= below.uv && !(is_shape && child.object->category == "texture");
    use.wireframe |= below.wireframe;
    use.place |= below.place;
    for (const std::string& name : below.attributes)
      if (std::find(use.attributes.begin(), use.attributes.end(), name) == use.attributes.end())
        use.attributes.push_back(name);
  }
  return use;
}

const SceneBuilder::TextureUse& SceneBuilder::texture_use_of_part(const description::Object& object) {
  if (const auto known = texture_uses_.find(&object); known != texture_uses_.end()) return known->second;
  TextureUse use = texture_use(object);
  return texture_uses_.emplace(&object, std::move(use)).first->second;
}

// Lamps and meters must be round: they are sampled by area.
bool SceneBuilder::is_stretched_surface(const description::Object& shape) const {
  return shape.children_of("emitter").empty() && &shape != measured_object_ && is_stretched(shape);
}

Result<std::uint32_t> SceneBuilder::bsdf_of(const description::Object& shape, bool emits) {
  const auto objects = shape.children_of("bsdf");
  if (objects.size() > 1) return error_at(shape, "shape '" + shape.plugin + "' has more than one bsdf");
  return bsdf_of(shape, emits, objects.empty() ? nullptr : objects[0]);
}

Result<std::uint32_t> SceneBuilder::bsdf_of(const description::Object& shape, bool emits,
                                            const description::ObjectPtr& given) {
  if (given == nullptr) {
    // Between two media there is no surface: the shape bounds them and is not seen, as Mitsuba documents it.
    if (!emits && !shape.children_of("medium").empty()) {
      if (null_bsdf_ == kNone) {
        description::Object null;
        null.category = "bsdf";
        null.plugin = "null";
        null.where = shape.where;
        CANDELA_ASSIGN(Bsdf bsdf, Bsdf::build(null, textures_));
        bsdfs_.push_back(std::move(bsdf));
        null_bsdf_ = static_cast<std::uint32_t>(bsdfs_.size() - 1);
      }
      return null_bsdf_;
    }
    // As Mitsuba: diffuse of reflectance 0.5, or black where the shape is a lamp.
    std::uint32_t& slot = emits ? black_bsdf_ : default_bsdf_;
    if (slot == kNone) {
      if (emits) {
        description::Object black;
        black.category = "bsdf";
        black.plugin = "diffuse";
        black.where = shape.where;
        black.properties.push_back(
            {"reflectance", description::PropertyType::rgb, description::Rgb{{0, 0, 0}}, shape.where});
        CANDELA_ASSIGN(Bsdf bsdf, Bsdf::build(black, textures_));
        bsdfs_.push_back(std::move(bsdf));
      } else {
        bsdfs_.push_back(Bsdf::default_diffuse());
      }
      slot = static_cast<std::uint32_t>(bsdfs_.size() - 1);
    }
    return slot;
  }
  const auto known = bsdf_of_object_.find(given.get());
  if (known != bsdf_of_object_.end()) return known->second;
  CANDELA_TRY(count(*given, sizeof(Bsdf) + kMapEntryBytes, "bsdfs"));
  CANDELA_ASSIGN(Bsdf bsdf, Bsdf::build(*given, textures_, coats_));
  CANDELA_TRY(count(*given, bsdf.arena_parts() * sizeof(Bsdf), "bsdfs"));
  bsdfs_.push_back(std::move(bsdf));
  const auto index = static_cast<std::uint32_t>(bsdfs_.size() - 1);
  bsdf_of_object_[given.get()] = index;
  return index;
}

void SceneBuilder::count_bsdf(const Bsdf& bsdf) {
  std::vector<std::string> plugins;
  bsdf.collect_plugins(plugins);
  for (const std::string& plugin : plugins) ++features_.bsdf_kinds[plugin];
  const BsdfFacts facts = bsdf.facts();
  features_.any_delta_bsdf |= facts.delta;
  all_delta_ = all_delta_ && !facts.smooth;
  features_.any_rough_glossy |= !facts.delta && facts.min_roughness < 0.2f;
  features_.any_transmission |= facts.transmissive;
  features_.any_passthrough |= facts.passthrough;
  features_.any_black_bsdf |= facts.black();
  features_.any_two_sided |= facts.two_sided;
}

Result<void> SceneBuilder::shapes(const description::Object& scene) {
  const auto all = scene.children_of("shape");
  for (const auto& shape : all) CANDELA_TRY(read_attributes(*shape));
  for (const auto& shape : all) {
    work_step();
    if (shape->plugin != "shapegroup" && shape->plugin != "instance" && !is_stretched_surface(*shape))
      CANDELA_TRY(add_shape(*shape, nullptr));
  }
  // The scene's own shapes come first, then those of each group.
  for (const auto& shape : all) {
    work_step();
    if (shape->plugin == "instance") CANDELA_TRY(instance(*shape));
    if (is_stretched_surface(*shape)) CANDELA_TRY(stretched(*shape));
  }
  return {};
}

Result<void> SceneBuilder::read_attributes(const description::Object& object) {
  work_step();
  // The instances of a group share it.
  if (object.plugin == "shapegroup" && !read_groups_.insert(&object).second) return {};
  for (const auto& shape : object.children_of("shape")) CANDELA_TRY(read_attributes(*shape));
  const std::vector<std::string> names = texture_use(object).attributes;
  if (names.empty() || read_shapes_.contains(&object)) return {};
  CANDELA_ASSIGN(Shape shape, build_shape(object, files_, names));
  if (!is_empty(shape)) geometry_.expect(shape.attributes);
  read_shapes_.emplace(&object, std::move(shape));
  return {};
}

Result<std::uint32_t> SceneBuilder::group_of(const description::ObjectPtr& object) {
  const auto known = group_of_object_.find(object.get());
  if (known != group_of_object_.end()) return known->second;
  const auto shapes = object->children_of("shape");
  if (shapes.empty()) return error_at(*object, "the shapegroup has no shapes");
  CANDELA_TRY(count(*object, sizeof(Group) + kMapEntryBytes, "shapegroups"));
  std::uint32_t group = geometry_.begin_group();
  for (const auto& shape : shapes) {
    work_step();
    CANDELA_TRY(add_shape(*shape, object.get()));
  }
  if (geometry_.groups.back().bounds.empty()) {
    geometry_.groups.pop_back();
    group = kNone;
  }
  group_of_object_[object.get()] = group;
  return group;
}

Result<void> SceneBuilder::leave_out(const description::Object& object, const Shape& shape) {
  if (&object == measured_object_) return error_at(object, "no face of the measured mesh has an area");
  features_.dropped_faces += shape.dropped_count;
  for (const Vec3& p : shape.positions) left_out_.add(Vec3d(p));
  warnings_.push_back(fmt::format("{}:{}: left out shape '{}': none of its {} faces has an area",
                                  object.where.file, object.where.line, object.plugin, shape.dropped_count));
  return {};
}

Result<void> SceneBuilder::instance(const description::Object& object) {
  const auto groups = object.children_of("shape");
  if (groups.size() != 1 || groups[0]->plugin != "shapegroup") {
    return error_at(object, "an instance needs one shapegroup, given by a reference to its id");
  }
  CANDELA_ASSIGN(const std::uint32_t group, group_of(groups[0]));
  if (group == kNone) return {};
  return add_instance(object, group);
}

Result<void> SceneBuilder::stretched(const description::Object& object) {
  description::Object round = object;
  std::erase_if(round.properties, [](const description::Property& p) { return p.name == "to_world"; });
  CANDELA_TRY(count(object, sizeof(Group), "stretched shapes"));
  const std::uint32_t group = geometry_.begin_group();
  CANDELA_TRY(add_shape(round, &object));
  return add_instance(object, group);
}

Result<void> SceneBuilder::add_instance(const description::Object& object, std::uint32_t group) {
  const Transform to_world(object.get_transform("to_world"));
  if (to_world.determinant() == 0 || !std::isfinite(1 / to_world.determinant())) {
    return error_at(object, "to_world is singular").with_field("to_world");
  }
  CANDELA_TRY(count(object, sizeof(Instance), "instances"));
  geometry_.add_instance(group, to_world);
  if (!(geometry_.instances.back().inverse_norm <= 1.8e18)) {
    return error_at(object, "to_world makes the instance smaller than 1e-18 of its group")
        .with_field("to_world");
  }
  const Bounds& bounds = geometry_.instances.back().bounds;
  for (const Vec3d p : {bounds.low, bounds.high}) {
    if (!(std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) <= 1e18)) {
      return error_at(object, "the instance lies beyond 1e18 in the scene");
    }
  }
  return {};
}

Result<void> SceneBuilder::add_shape(const description::Object& object, const description::Object* group) {
  const bool in_group = group != nullptr;
  const auto emitters = object.children_of("emitter");
  if (in_group && !emitters.empty()) {
    return error_at(*emitters[0], "a shape inside a shapegroup cannot be an emitter")
        .with_mend("take it out of the shapegroup");
  }
  if (emitters.size() > 1) return error_at(object, "shape '" + object.plugin + "' has more than one emitter");
  if (!emitters.empty() && emitters[0]->plugin != "area") {
    return error_at(*emitters[0],
                    "a shape cannot be an emitter of type '" + emitters[0]->plugin + "' (area can)");
  }
  // Its textures may look at attributes that nobody has then.
  if (const auto read = read_shapes_.find(&object); read != read_shapes_.end() && is_empty(read->second))
    return leave_out(object, read->second);
  if (has_bsdfs_by_name(object)) return add_parts(object, group);
  ShapeRecord record;
  CANDELA_ASSIGN(record.medium_interface, media_.add_interface(object, files_));
  CANDELA_ASSIGN(record.bsdf, bsdf_of(object, !emitters.empty()));
  const TextureUse use = texture_use(object);
  Shape shape;
  if (const auto read = read_shapes_.find(&object); read != read_shapes_.end()) {
    shape = std::move(read->second);
    read_shapes_.erase(read);
  } else if (object.plugin == "heightfield") {
    CANDELA_ASSIGN(shape, build_heightfield(object, files_, textures_));
  } else {
    CANDELA_ASSIGN(shape, build_shape(object, files_, use.attributes));
  }
  return add_built(object, std::move(shape), record, group);
}

Result<void> SceneBuilder::add_parts(const description::Object& object, const description::Object* group) {
  CANDELA_ASSIGN(std::vector<BsdfShape> parts, build_parts(object, files_));
  const bool emits = !object.children_of("emitter").empty();
  if (parts.size() > 1 && (emits || &object == measured_object_)) {
    return error_at(object, "an OBJ file whose parts have bsdfs of their own can neither glow nor measure")
        .with_mend("give all of it one bsdf without a name, or choose a part by shape_index");
  }
  ShapeRecord record;
  CANDELA_ASSIGN(record.medium_interface, media_.add_interface(object, files_));
  for (BsdfShape& part : parts) {
    CANDELA_ASSIGN(record.bsdf, bsdf_of(object, emits, part.bsdf));
    CANDELA_TRY(add_built(object, std::move(part.shape), record, group, part.bsdf.get()));
  }
  return {};
}

Result<void> SceneBuilder::add_built(const description::Object& object, Shape shape, ShapeRecord record,
                                     const description::Object* group, const description::Object* part) {
  const bool in_group = group != nullptr;
  if (is_empty(shape)) return leave_out(object, shape);
  const auto emitters = object.children_of("emitter");
  const TextureUse use = texture_use(object);
  record.reads_uv = use.uv;
  record.reads_mean_edge = use.wireframe;
  record.reads_partials = bsdfs_[record.bsdf].facts().reads_partials;
  if (parameterized_) record.reads_uv = record.reads_partials = true;
  // A tangent frame in the world needs the derivative that it follows.
  record.reads_partials |= in_group && record.reads_uv;
  features_.dropped_faces += shape.dropped_count;
  if (shape.dropped_count > 0) {
    warnings_.push_back(object.where.file + ":" + std::to_string(object.where.line) + ": left out " +
                        std::to_string(shape.dropped_count) + " faces without area");
  }
  if (geometry_.positions.size() + shape.positions.size() > kMaxPrimitives ||
      geometry_.indices.size() + shape.triangles.size() > kMaxPrimitives) {
    return error_at(object, "the scene has more than 2^32 triangles or vertices");
  }
  CANDELA_TRY(count(object,
                    memory_of(shape) + sizeof(ShapeRecord) + sizeof(ShapePlace) +
                        description::heap_bytes(object.where) + description::heap_bytes(object.id),
                    "shapes"));
  count_bsdf(bsdfs_[record.bsdf]);
  const auto index = static_cast<std::uint32_t>(geometry_.shapes.size());
  if (!emitters.empty()) {
    // Samples of a rectangle do not name the triangle that they are on, which a wireframe reads: the lamp is
    // a mesh.
    CANDELA_TRY(count(object, sizeof(AreaEmitter) + kLightBytes, "lights"));
    const bool as_mesh = texture_use_of_part(*emitters[0]).wireframe;
    area_emitters_.push_back({index, as_mesh ? std::nullopt : shape.rectangle, emitters[0]});
  }
  if (&object == measured_object_ && !in_group) {
    measured_ = index;
    measured_rectangle_ = shape.rectangle;
  }
  geometry_.add(std::move(shape), record);
  if (names_) {
    objects_.of_shape.push_back(object_named(letters::kSurfaceObject, names_->of_shape(object, group, part)));
    matte_shapes_.push_back({&object, group, part});
  }
  shape_places_.push_back({object.where.file, object.where.line, object.id});
  return {};
}

Result<ColorTexture> SceneBuilder::radiance_of(const AreaEmitter& area) {
  const description::ObjectPtr& object = area.object;
  CANDELA_ASSIGN(const ColorTexture radiance, textures_.color(*object, "radiance", Spectrum(1.0f)));
  if (object->find("power") == nullptr) return radiance;
  const Emitter light =
      make_area_light(geometry_, area.shape, area.rectangle ? &*area.rectangle : nullptr, radiance);
  const SceneExtent extent;
  const double power = static_cast<double>(
      luminance(visit_emitter(light, [&](const auto& emitter) { return emitter.power(extent); })));
  const auto factor = static_cast<float>(object->get_number("power", 0) / power);
  if (!std::isfinite(factor))
    return error_at(*object, "a black light cannot be scaled to a power").with_field("power");
  return textures_.scaled(radiance, factor);
}

std::optional<Placement> SceneBuilder::far_placement(const std::optional<Vec3d>& camera) const {
  Placement placement;
  Bounds bounds = geometry_.bounds;
  // Faces without area out there may have one near the origin.
  bounds.add(left_out_);
  if (!bounds.empty() && camera) bounds.add(*camera);
  const std::optional<Vec3d> middle = middle_if_far(bounds);
  placement.middle = middle.value_or(Vec3d{});
  for (const auto& [object, group] : group_of_object_) {
    if (group == kNone) continue;  // left out
    if (const auto of_group = middle_if_far(geometry_.groups[group].bounds))
      placement.groups.emplace(object, *of_group);
  }
  if (!middle && placement.groups.empty()) return std::nullopt;
  return placement;
}

void SceneBuilder::make_triangles() {
  if (!std::exchange(triangles_made_, true)) scene::make_triangles(geometry_);
}

Result<void> SceneBuilder::finish_geometry(bool with_triangles) {
  for (const std::string& warning : warnings_) log::warn(warning);
  if (with_triangles || !area_emitters_.empty()) make_triangles();
  for (const AreaEmitter& area : area_emitters_) {
    CANDELA_ASSIGN(const ColorTexture radiance, radiance_of(area));
    if (radiance.is_constant() && !is_radiometric(radiance.constant)) {
      return error_at(*area.object, "radiance must be finite and not negative").with_field("radiance");
    }
    // A black lamp is none: nobody need choose it.
    if (radiance.is_constant() && radiance.constant.is_black()) continue;
    geometry_.shapes[area.shape].emitter =
        lights_.add_area(area.shape, area.rectangle ? &*area.rectangle : nullptr, radiance);
    name_lamp(*area.object);
    emitter_media_.resize(lights_.size(), kNone);
    emitter_media_.back() = media_.exterior(geometry_.shapes[area.shape].medium_interface);
    ++features_.emitter_kinds["area"];
    features_.any_area_emitter = true;
    features_.any_rectangle_emitter |= area.rectangle.has_value();
    features_.any_mesh_emitter |= !area.rectangle && geometry_.shapes[area.shape].triangle_count > 0;
    features_.any_textured_emitter |= !radiance.is_constant();
    const double extent = 2 * geometry_.bounds_of_shape(area.shape).radius();
    features_.largest_area_emitter = std::max(features_.largest_area_emitter, static_cast<float>(extent));
    features_.max_emitted_radiance = std::max(features_.max_emitted_radiance, luminance(radiance.maximum()));
  }
  return {};
}

Result<void> SceneBuilder::emitter(const description::Object& object) {
  if (object.plugin != "area" && texture_use_of_part(object).place)
    return error_at(
        object,
        fmt::format("a mesh_attribute, wireframe or volume texture needs a surface; a '{}' light has none",
                    object.plugin));
  if (object.plugin == "area") return {};  // glows in the shapes that refer to it, as in Mitsuba 3
  CANDELA_TRY(count(object, kLightBytes, "lights"));
  CANDELA_ASSIGN(std::optional<Emitter> light, build_emitter(object, textures_));
  if (!light) return {};
  visit_emitter(*light, [&](const auto& e) {
    if constexpr (requires { e.max_radiance(0.0); }) {
      features_.any_delta_emitter |= e.kDelta;
      features_.max_emitted_radiance =
          std::max(features_.max_emitted_radiance, e.max_radiance(geometry_.bounds.radius()));
    }
    if constexpr (std::is_same_v<decltype(e), const Environment&>) {
      features_.any_environment = true;
      features_.environment_variation = std::max(features_.environment_variation, e.variation());
    }
  });
  lights_.add(*std::move(light));
  name_lamp(object);
  ++features_.emitter_kinds[object.plugin];
  if (const auto media = object.children_of("medium"); !media.empty()) {
    CANDELA_ASSIGN(const std::uint32_t medium, media_.add(media[0], files_));
    emitter_media_.resize(lights_.size(), kNone);
    emitter_media_.back() = medium;
  }
  return {};
}

}  // namespace candela::scene
