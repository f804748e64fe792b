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

std::vector<std::string> ObjectNamesOfScene::of_shape(const Object& shape, const Object* group,
                                                      const Object* part) const {
  std::vector<std::string> names;
  const auto add = [&](const std::string& name) {
    if (!name.empty() && std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  };
  add(shape.id);
  if (group != nullptr) add(group->id);
  const auto only_bsdf = [](const Object& object) {
    const std::vector<ObjectPtr> bsdfs = object.children_of("bsdf");
    return bsdfs.size() == 1 ? bsdfs[0].get() : nullptr;
  };
  for (const Object* bsdf = part != nullptr ? part : only_bsdf(shape); bsdf != nullptr;
       bsdf = only_bsdf(*bsdf))
    add(bsdf->id);
  for (const ObjectPtr& emitter : shape.children_of("emitter"))
    if (const auto lamp = lamps_.find(emitter.get()); lamp != lamps_.end()) add(lamp->second);
  return names;
}

}  // namespace candela::description
