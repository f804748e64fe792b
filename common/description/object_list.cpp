#include "common/description/object_list.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include "common/description/object_names.h"
#include "common/edits/selection.h"
#include "common/image/denoise.h"
#include "common/letters/automaton.h"

namespace candela::description {
namespace {

// ---- bounds ----

// A box that no point is in yet has low above high.
constexpr double kFar = std::numeric_limits<double>::infinity();
constexpr Box kNowhere = {{kFar, kFar, kFar}, {-kFar, -kFar, -kFar}};

void extend(Box& box, const Vec3& point) {
  for (std::size_t i = 0; i < 3; ++i) {
    box.low[i] = std::min(box.low[i], point[i]);
    box.high[i] = std::max(box.high[i], point[i]);
  }
}

Box transformed(const Box& box, const Mat4& m) {
  Box result = kNowhere;
  for (unsigned corner = 0; corner < 8; ++corner) {
    Vec3 p{}, q{};
    for (std::size_t i = 0; i < 3; ++i) p[i] = (corner >> i & 1) != 0 ? box.high[i] : box.low[i];
    for (std::size_t i = 0; i < 3; ++i)
      q[i] = m[4 * i] * p[0] + m[4 * i + 1] * p[1] + m[4 * i + 2] * p[2] + m[4 * i + 3];
    extend(result, q);
  }
  return result;
}

// Bounds a shape that neither a file nor a list describes, in the world or in its shapegroup's space.
std::optional<Box> bounds_of_shape(const Object& shape) {
  Box box;
  const auto add_ball = [](Box& to, const Vec3& center, double radius) {
    for (const double side : {-radius, radius})
      extend(to, {center[0] + side, center[1] + side, center[2] + side});
  };
  if (shape.plugin == "rectangle" || shape.plugin == "disk") {
    box = {{-1, -1, 0}, {1, 1, 0}};
  } else if (shape.plugin == "cube") {
    box = {{-1, -1, -1}, {1, 1, 1}};
  } else if (shape.plugin == "sphere") {
    box = kNowhere;
    add_ball(box, shape.get_vec3("center", {0, 0, 0}), std::abs(shape.get_number("radius", 1)));
  } else if (shape.plugin == "cylinder") {
    box = kNowhere;
    for (const Vec3& end : {shape.get_vec3("p0", {0, 0, 0}), shape.get_vec3("p1", {0, 0, 1})})
      add_ball(box, end, std::abs(shape.get_number("radius", 1)));
  } else {
    return std::nullopt;
  }
  return transformed(box, shape.get_transform("to_world"));
}

std::optional<Box> bounds_of_lamp(const Object& emitter) {
  if (emitter.plugin == "directional" || emitter.plugin == "constant" || emitter.plugin == "envmap" ||
      emitter.plugin.find("sky") != std::string::npos || emitter.plugin == "sun")
    return std::nullopt;
  Vec3 at = {0, 0, 0};
  if (emitter.find("position") != nullptr) {
    at = emitter.get_vec3("position", at);
  } else {
    const Mat4 m = emitter.get_transform("to_world");
    at = {m[3], m[7], m[11]};
  }
  return Box{at, at};
}

// ---- rows ----

class Rows {
 public:
  void add(const std::string& name, const std::map<std::string, std::uint64_t>& kinds,
           const std::optional<Box>& bounds) {
    const auto [found, is_new] = index_.try_emplace(name, rows_.size());
    if (is_new) rows_.push_back({name, {}, kNowhere});
    NamedObjects& row = rows_[found->second];
    for (const auto& [kind, count] : kinds) row.kinds[kind] += count;
    if (!bounds) row.bounds.reset();
    if (!row.bounds) return;
    extend(*row.bounds, bounds->low);
    extend(*row.bounds, bounds->high);
  }
  const std::vector<NamedObjects>& rows() const { return rows_; }
  std::vector<NamedObjects> take() { return std::move(rows_); }

 private:
  std::vector<NamedObjects> rows_;
  std::map<std::string, std::size_t> index_;
};

struct Lists {
  Rows surfaces, lamps, media;
};

class Lister {
 public:
  explicit Lister(const Object& scene) : names_(scene) {
    for (const Child& child : scene.children) {
      const Object& object = *child.object;
      if (object.category == "emitter" && object.plugin != "area") {
        lists_.lamps.add(names_.of_lamp(object), {{object.plugin, 1}}, bounds_of_lamp(object));
        add_media(object, std::nullopt, lists_);
      }
      if (object.category == "sensor") add_media(object, std::nullopt, lists_);
      if (object.category != "shape" || object.plugin == "shapegroup") continue;
      if (object.plugin == "instance")
        add_instance(object);
      else
        add_shape(object, nullptr, lists_);
    }
  }
  ObjectList take() { return {lists_.surfaces.take(), lists_.lamps.take(), lists_.media.take()}; }

 private:
  void add_shape(const Object& shape, const Object* group, Lists& to) {
    const std::optional<Box> bounds = bounds_of_shape(shape);
    std::set<std::string> lamps;
    for (const ObjectPtr& emitter : shape.children_of("emitter")) {
      lamps.insert(names_.of_lamp(*emitter));
      to.lamps.add(names_.of_lamp(*emitter), {{emitter->plugin, 1}}, bounds);
    }
    const std::vector<std::string> names = names_of(shape, group);
    for (const std::string& name : names)
      if (!lamps.contains(name) || name == shape.id) to.surfaces.add(name, {{shape.plugin, 1}}, bounds);
    if (names.empty()) to.surfaces.add("", {{shape.plugin, 1}}, bounds);
    add_media(shape, bounds, to);
  }

  // With the names of all parts of a mesh that has several bsdfs.
  std::vector<std::string> names_of(const Object& shape, const Object* group) const {
    std::vector<std::string> names = names_.of_shape(shape, group);
    const std::vector<ObjectPtr> bsdfs = shape.children_of("bsdf");
    for (std::size_t i = 0; bsdfs.size() > 1 && i < bsdfs.size(); ++i)
      for (const std::string& name : names_.of_shape(shape, group, bsdfs[i].get()))
        if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
    return names;
  }

  void add_media(const Object& object, const std::optional<Box>& bounds, Lists& to) {
    for (const Child& child : object.children)
      if (child.object->category == "medium")
        to.media.add(names_.of_medium(*child.object), {{child.object->plugin, 1}},
                     child.slot == "interior" ? bounds : std::nullopt);
  }

  void add_instance(const Object& instance) {
    const std::vector<ObjectPtr> groups = instance.children_of("shape");
    if (groups.empty()) return;
    const auto [group, is_new] = groups_.try_emplace(groups[0].get());
    if (is_new)
      for (const ObjectPtr& shape : groups[0]->children_of("shape"))
        add_shape(*shape, groups[0].get(), group->second);
    const Mat4 to_world = instance.get_transform("to_world");
    const auto place = [&](const Rows& from, Rows& to) {
      for (const NamedObjects& row : from.rows())
        to.add(row.name, row.kinds,
               row.bounds ? std::optional(transformed(*row.bounds, to_world)) : std::nullopt);
    };
    place(group->second.surfaces, lists_.surfaces);
    place(group->second.media, lists_.media);
  }

  ObjectNamesOfScene names_;
  std::map<const Object*, Lists> groups_;  // in their own space
  Lists lists_;
};

}  // namespace

std::uint64_t NamedObjects::count() const {
  std::uint64_t sum = 0;
  for (const auto& [kind, count] : kinds) sum += count;
  return sum;
}

ObjectList list_objects(const Object& scene) {
  return Lister(scene).take();
}

LetterObjects letter_objects(const Object& scene) {
  const ObjectNamesOfScene names(scene);
  LetterObjects objects;
  const auto add = [&](std::vector<std::string> of_object, letters::ObjectUse use) {
    objects.names.push_back(std::move(of_object));
    objects.uses.push_back(use);
  };
  const auto add_shape = [&](const Object& shape, const Object* group) {
    const std::vector<ObjectPtr> bsdfs = shape.children_of("bsdf");
    if (bsdfs.size() < 2) add(names.of_shape(shape, group), letters::kSurfaceObject);
    for (std::size_t b = 0; bsdfs.size() > 1 && b < bsdfs.size(); ++b)
      add(names.of_shape(shape, group, bsdfs[b].get()), letters::kSurfaceObject);
  };
  std::set<const Object*> groups;
  for (const ObjectPtr& shape : scene.children_of("shape")) {
    if (shape->plugin == "shapegroup") continue;
    if (shape->plugin != "instance")
      add_shape(*shape, nullptr);
    else
      for (const ObjectPtr& group : shape->children_of("shape"))
        if (groups.insert(group.get()).second)
          for (const ObjectPtr& below : group->children_of("shape")) add_shape(*below, group.get());
  }
  for (const Object* lamp : names.lamps()) {
    objects.lamp_names.push_back(names.of_lamp(*lamp));
    add({names.of_lamp(*lamp)}, letters::kLampObject);
  }
  for (const Object* medium : names.media()) add({names.of_medium(*medium)}, letters::kMediumObject);
  return objects;
}

Result<void> check_layers(const letters::LayerRequest& request, const Object& scene) {
  CANDELA_TRY(letters::check(request));
  if (request.empty()) return {};
  // Films of older jobs may have such a layer; `convert --denoise` adds one, and a mix leaves it out.
  for (const letters::NamedExpression& layer : request.layers)
    if (layer.name == image::kDenoisedLayer)
      return input_error(
          fmt::format("a layer cannot be called '{}': the denoised image has that name", layer.name));
  const LetterObjects objects = letter_objects(scene);
  const letters::LayerRequest expanded = letters::expand_light_groups(request, objects.lamp_names);
  if (expanded.empty() && expanded != letters::LayerRequest{})
    return input_error("light groups make no layer: the scene has no lamp")
        .with_mend("leave them out, or add a lamp to the scene");
  const auto compiled = letters::Automaton::compile(expanded, objects.names, objects.uses);
  if (!compiled.ok()) return compiled.error();
  return {};
}

Result<void> check_edits(const edits::EditList& list, const Object& scene) {
  if (list.empty()) return {};
  const LetterObjects objects = letter_objects(scene);
  std::vector<edits::Selection> selections;
  for (const edits::Edit& edit : list.edits) {
    CANDELA_ASSIGN(edits::Selection selection,
                   edits::Selection::compile(list, edit, objects.names, objects.uses));
    selections.push_back(std::move(selection));
  }
  return edits::check_by_path(list, selections, objects.names, objects.uses);
}

}  // namespace candela::description
