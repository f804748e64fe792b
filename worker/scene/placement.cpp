#include "worker/scene/placement.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string_view>
#include <utility>

#include "common/base/work_monitor.h"
#include "common/description/transform.h"
#include "worker/scene/transform.h"

namespace candela::scene {
namespace {

namespace transform = description::transform;
using description::Mat4;
using description::Object;
using description::ObjectPtr;
using description::PropertyType;

// A scene is far from the origin if its middle is more than this many of its radii away.
constexpr double kFar = 8;

template <class Value>
void set(Object& object, const char* name, PropertyType type, Value value) {
  for (description::Property& property : object.properties)
    if (property.name == name) {
      property.type = type;
      property.value = value;
      return;
    }
  object.properties.push_back({name, type, value, object.where});
}

description::Vec3 triple(const Vec3d& v) {
  return {v.x, v.y, v.z};
}
Vec3d vector_of(const description::Vec3& v) {
  return {v[0], v[1], v[2]};
}

bool is_mesh_file(const Object& shape) {
  return shape.plugin == "obj" || shape.plugin == "ply" || shape.plugin == "serialized" ||
         (shape.plugin == "pbrtmesh" && shape.get_integer("curves", 0) == 0);
}

// Emitters that lie nowhere, or where their shape is.
bool is_placed(const Object& emitter) {
  constexpr std::string_view kNowhere[] = {"area", "constant", "envmap", "directional",
                                           "sky",  "sun",      "sunsky"};
  return std::find(std::begin(kNowhere), std::end(kNowhere), emitter.plugin) == std::end(kNowhere);
}

class Mover {
 public:
  explicit Mover(const Placement& placement) : placement_(placement) {}

  // `group`: the shapegroup that a shape is in, or null.
  ObjectPtr move(const ObjectPtr& object, const Object* group = nullptr) {
    const auto key = std::pair(object.get(), group);
    if (const auto known = moved_.find(key); known != moved_.end()) return known->second;
    work_step();
    auto out = std::make_shared<Object>(*object);
    const bool is_group = object->category == "shape" && object->plugin == "shapegroup";
    bool changed = place(*out, *object, group);
    for (description::Child& child : out->children) {
      // An object of a shape of a group, such as a volume, lies in the world.
      const bool inside = is_group && child.object->category == "shape";
      ObjectPtr of_child = move(child.object, inside ? object.get() : nullptr);
      changed |= of_child != child.object;
      child.object = std::move(of_child);
    }
    return moved_[key] = changed ? std::shared_ptr<const Object>(std::move(out)) : object;
  }

 private:
  Vec3d middle_of(const Object* group) const {
    if (group == nullptr) return placement_.middle;
    const auto found = placement_.groups.find(group);
    return found == placement_.groups.end() ? Vec3d{} : found->second;
  }

  static void shift(Object& out, const Vec3d& middle) {
    set(out, "to_world", PropertyType::transform,
        transform::multiply(transform::translate(triple(-middle)), out.get_transform("to_world")));
  }

  // True if it changed `out`, a copy of `object`.
  bool place(Object& out, const Object& object, const Object* group) const {
    const Vec3d middle = middle_of(group);
    const bool here = middle.x == 0 && middle.y == 0 && middle.z == 0;
    if (object.category == "shape")
      return object.plugin != "shapegroup" && place_shape(out, object, middle, here);
    if (here) return false;
    if (object.category == "sensor") {
      if (object.find("target") != nullptr)
        set(out, "target", PropertyType::point, triple(vector_of(object.get_vec3("target", {})) - middle));
      // A direction of a distant sensor excludes to_world, and needs no place.
      if (object.find("direction") == nullptr) shift(out, middle);
      return true;
    }
    if (object.category == "emitter") {
      if (!is_placed(object)) return false;
      if (object.find("position") != nullptr)
        set(out, "position", PropertyType::point,
            triple(vector_of(object.get_vec3("position", {})) - middle));
      else
        shift(out, middle);
      return true;
    }
    if (object.category != "volume" || object.plugin == "constvolume") return false;
    shift(out, middle);
    return true;
  }

  bool place_shape(Object& out, const Object& object, const Vec3d& middle, bool here) const {
    if (object.plugin == "instance") {
      const auto groups = object.children_of("shape");
      const Vec3d of_group = groups.empty() ? Vec3d{} : middle_in_group(groups[0].get());
      if (here && of_group.x == 0 && of_group.y == 0 && of_group.z == 0) return false;
      set(out, "to_world", PropertyType::transform,
          transform::multiply(object.get_transform("to_world"), transform::translate(triple(of_group))));
      shift(out, middle);
      return true;
    }
    if (here) return false;
    // The point of the shape's own space that goes to the origin: large numbers cancel in the transform.
    Vec3d origin;
    const Transform to_world(object.get_transform("to_world"));
    if (is_mesh_file(object) && to_world.determinant() != 0) {
      origin = to_world.inverse_point(middle);
      set(out, "origin", PropertyType::point, triple(origin));
    } else if (object.plugin == "sphere") {
      origin = vector_of(object.get_vec3("center", {0, 0, 0}));
      set(out, "center", PropertyType::point, description::Vec3{});
    } else if (object.plugin == "cylinder") {
      origin = vector_of(object.get_vec3("p0", {0, 0, 0}));
      const Vec3d end = vector_of(object.get_vec3("p1", {0, 0, 1}));
      set(out, "p0", PropertyType::point, description::Vec3{});
      set(out, "p1", PropertyType::point, triple(end - origin));
    }
    set(out, "to_world", PropertyType::transform,
        transform::multiply(object.get_transform("to_world"), transform::translate(triple(origin))));
    shift(out, middle);
    return true;
  }

  Vec3d middle_in_group(const Object* group) const { return group == nullptr ? Vec3d{} : middle_of(group); }

  const Placement& placement_;
  std::map<std::pair<const Object*, const Object*>, ObjectPtr> moved_;
};

}  // namespace

std::optional<Vec3d> middle_if_far(const Bounds& bounds) {
  const double radius = bounds.radius();
  const Vec3d center = bounds.center();
  const double away = std::max({std::abs(center.x), std::abs(center.y), std::abs(center.z)});
  if (!(radius > 0) || !(away > kFar * radius) || !std::isfinite(away)) return std::nullopt;
  const double step = std::ldexp(1.0, std::ilogb(radius));
  const auto rounded = [&](double x) { return std::nearbyint(x / step) * step; };
  return Vec3d{rounded(center.x), rounded(center.y), rounded(center.z)};
}

std::optional<Vec3d> camera_place(const description::Object& sensor) {
  if (sensor.plugin == "irradiancemeter" || sensor.plugin == "distant") return std::nullopt;
  return Transform(sensor.get_transform("to_world")).translation();
}

Placement placement_at(const description::Object& scene, const Vec3d& camera) {
  Placement placement{camera, {}};
  for (const ObjectPtr& shape : scene.children_of("shape")) {
    const auto groups = shape->children_of("shape");
    const Transform to_world(shape->get_transform("to_world"));
    if (shape->plugin == "instance" && !groups.empty() && to_world.determinant() != 0)
      placement.groups.emplace(groups[0].get(), to_world.inverse_point(camera));
  }
  return placement;
}

description::ObjectPtr moved(const description::ObjectPtr& scene, const Placement& placement) {
  return Mover(placement).move(scene);
}

}  // namespace candela::scene
