#include "common/description/object_names.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

namespace candela::description {

ObjectNamesOfScene::ObjectNamesOfScene(const Object& scene) {
  visit(scene);
  name_all(lamp_order_, lamps_);
  name_all(medium_order_, media_);
}

void ObjectNamesOfScene::visit(const Object& object) {
  for (const Child& child : object.children) {
    const Object& below = *child.object;
    // An area light of the scene itself glows only in the shapes that refer to it.
    if (below.category == "emitter" && (object.category == "shape" || below.plugin != "area")) {
      const bool as_shape = below.id.empty() && object.category == "shape";
      if (lamps_.emplace(&below, as_shape ? object.id : below.id).second) lamp_order_.push_back(&below);
      visit(below);
    } else if (below.category == "medium") {
      if (media_.emplace(&below, below.id).second) medium_order_.push_back(&below);
    } else if (below.category == "shape" || below.category == "sensor") {
      // The instances of a shapegroup share it.
      if (below.plugin != "shapegroup" || groups_.insert(&below).second) visit(below);
    }
  }
}

void ObjectNamesOfScene::name_all(const std::vector<const Object*>& order, Names& names) const {
  std::set<std::string> ids;
  for (const Object* object : order) ids.insert(names.at(object));
  std::map<std::string_view, int> numbers;  // of a kind
  for (const Object* object : order) {
    int& number = numbers[object->plugin];
    ++number;
    if (!names.at(object).empty()) continue;
    while (ids.contains(fmt::format("{}.{}", object->plugin, number))) ++number;
    names[object] = fmt::format("{}.{}", object->plugin, number);
  }
}

namespace {

// The bsdf that an object has alone; null: none or several.
const Object* only_bsdf(const Object& object) {
  const std::vector<ObjectPtr> bsdfs = object.children_of("bsdf");
  return bsdfs.size() == 1 ? bsdfs[0].get() : nullptr;
}

}  // namespace

MatteNames matte_names(const std::vector<MatteShape>& shapes) {
  const auto id_of = [](const MatteShape& one) {
    return !one.shape->id.empty() || one.group == nullptr ? one.shape->id : one.group->id;
  };
  std::set<std::string> ids;
  for (const MatteShape& one : shapes) ids.insert(id_of(one));
  std::map<std::string_view, int> numbers;     // of a kind
  std::map<const Object*, std::string> known;  // parts of a file are one object
  MatteNames names;
  for (const MatteShape& one : shapes) {
    const auto [at, fresh] = known.emplace(one.shape, id_of(one));
    std::string& name = at->second;
    if (fresh) {
      int& number = ++numbers[one.shape->plugin];
      const auto numbered = [&] { return fmt::format("{}.{}", one.shape->plugin, number); };
      while (name.empty() && ids.contains(numbered())) ++number;
      if (name.empty()) name = numbered();
    }
    std::string material;
    for (const Object* bsdf = one.part != nullptr ? one.part : only_bsdf(*one.shape);
         bsdf != nullptr && material.empty(); bsdf = only_bsdf(*bsdf))
      material = bsdf->id;
    names.materials.push_back(material.empty() ? name : std::move(material));
    names.objects.push_back(name);
  }
  return names;
}

std::vector<std::string> ObjectNamesOfScene::of_shape(const Object& shape, const Object* group,
                                                      const Object* part) const {
  std::vector<std::string> names;
  const auto add = [&](const std::string& name) {
    if (!name.empty() && std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  };
  add(shape.id);
  if (group != nullptr) add(group->id);
  for (const Object* bsdf = part != nullptr ? part : only_bsdf(shape); bsdf != nullptr;
       bsdf = only_bsdf(*bsdf))
    add(bsdf->id);
  for (const ObjectPtr& emitter : shape.children_of("emitter"))
    if (const auto lamp = lamps_.find(emitter.get()); lamp != lamps_.end()) add(lamp->second);
  return names;
}

}  // namespace candela::description
