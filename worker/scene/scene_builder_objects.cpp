// The names of the scene's objects.
#include "worker/scene/scene_builder.h"

namespace candela::scene {
namespace {

SceneObjects::Mattes numbered(const std::vector<std::string>& names) {
  SceneObjects::Mattes mattes;
  std::map<std::string, std::uint32_t> numbers;
  for (const std::string& name : names) {
    const auto [at, fresh] = numbers.emplace(name, static_cast<std::uint32_t>(numbers.size()));
    if (fresh) mattes.names.push_back(name);
    mattes.of_shape.push_back(at->second);
  }
  return mattes;
}

}  // namespace

std::uint32_t SceneBuilder::object_named(letters::ObjectUse use, std::vector<std::string> names) {
  const auto [at, fresh] = object_of_names_.emplace(std::pair(use, std::move(names)),
                                                    static_cast<std::uint32_t>(objects_.names.size()));
  if (fresh) {
    objects_.names.push_back(at->first.second);
    objects_.uses.push_back(static_cast<std::uint8_t>(use));
  }
  return at->second;
}

void SceneBuilder::name_lamp(const description::Object& emitter) {
  if (names_) objects_.of_emitter.push_back(object_named(letters::kLampObject, {names_->of_lamp(emitter)}));
}

void SceneBuilder::finish_objects() {
  if (!names_) return;
  objects_.of_medium.resize(media_.size());
  for (const auto& [object, index] : media_.known())
    objects_.of_medium[index] = object_named(letters::kMediumObject, {names_->of_medium(*object)});
  const description::MatteNames names = description::matte_names(matte_shapes_);
  objects_.object_mattes = numbered(names.objects);
  objects_.material_mattes = numbered(names.materials);
}

}  // namespace candela::scene
