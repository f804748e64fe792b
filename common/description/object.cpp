// Typed access to the properties and children of a described object.
#include "common/description/object.h"

#include <algorithm>
#include <cassert>

#include "common/base/enum_names.h"
#include "common/description/transform.h"

namespace candela::description {

std::string_view name(PropertyType type) {
  return name_of_value<PropertyType::transform>(
      {"boolean", "integer", "float", "string", "point", "vector", "rgb", "transform"}, type);
}

namespace {

// The value as T; a present value of another type is our own mistake, for the vocabulary has been obeyed.
template <class T>
const T* value_of(const Property* property) {
  if (property == nullptr) return nullptr;
  const T* value = std::get_if<T>(&property->value);
  assert(value != nullptr);
  return value;
}

}  // namespace

const Property* Object::find(std::string_view property_name) const {
  const auto found = std::find_if(properties.begin(), properties.end(),
                                  [&](const Property& property) { return property.name == property_name; });
  return found == properties.end() ? nullptr : &*found;
}

bool Object::get_bool(std::string_view property_name, bool otherwise) const {
  const bool* value = value_of<bool>(find(property_name));
  return value != nullptr ? *value : otherwise;
}

std::int64_t Object::get_integer(std::string_view property_name, std::int64_t otherwise) const {
  const std::int64_t* value = value_of<std::int64_t>(find(property_name));
  return value != nullptr ? *value : otherwise;
}

double Object::get_number(std::string_view property_name, double otherwise) const {
  const Property* property = find(property_name);
  if (property != nullptr && property->type == PropertyType::integer)
    return static_cast<double>(std::get<std::int64_t>(property->value));
  const double* value = value_of<double>(property);
  return value != nullptr ? *value : otherwise;
}

std::string Object::get_string(std::string_view property_name, std::string_view otherwise) const {
  const std::string* value = value_of<std::string>(find(property_name));
  return value != nullptr ? *value : std::string(otherwise);
}

Vec3 Object::get_vec3(std::string_view property_name, Vec3 otherwise) const {
  const Vec3* value = value_of<Vec3>(find(property_name));
  return value != nullptr ? *value : otherwise;
}

Mat4 Object::get_transform(std::string_view property_name) const {
  const Mat4* value = value_of<Mat4>(find(property_name));
  return value != nullptr ? *value : transform::identity;
}

std::optional<Rgb> Object::get_rgb(std::string_view property_name) const {
  const Property* property = find(property_name);
  if (property == nullptr) return std::nullopt;
  if (property->type == PropertyType::number || property->type == PropertyType::integer) {
    const double gray = get_number(property_name, 0);
    return Rgb{{gray, gray, gray}};
  }
  const Rgb* value = value_of<Rgb>(property);
  return value != nullptr ? std::optional<Rgb>(*value) : std::nullopt;
}

const Child* Object::find_child(std::string_view slot) const {
  const auto found =
      std::find_if(children.begin(), children.end(), [&](const Child& child) { return child.slot == slot; });
  return found == children.end() ? nullptr : &*found;
}

std::vector<ObjectPtr> Object::children_of(std::string_view wanted) const {
  std::vector<ObjectPtr> found;
  for (const Child& child : children)
    if (child.object->category == wanted) found.push_back(child.object);
  return found;
}

}  // namespace candela::description
