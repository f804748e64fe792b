#include "common/description/color.h"

#include <algorithm>
#include <array>
#include <string_view>
#include <unordered_set>
#include <vector>

namespace candela::description {
namespace {

// Properties whose text brings colors that the description does not hold.
bool names_colors(const Object& object, const Property& property) {
  static constexpr std::array<std::string_view, 5> kPictures = {"bitmap", "envmap", "projector", "gridvolume",
                                                                "mesh_attribute"};
  if (property.type != PropertyType::string) return false;
  if (property.name == "material") return true;
  return (property.name == "filename" || property.name == "name") &&
         std::find(kPictures.begin(), kPictures.end(), object.plugin) != kPictures.end();
}

bool is_gray(const Rgb& color) {
  return color.value[0] == color.value[1] && color.value[1] == color.value[2];
}

bool has_own_color(const Object& object) {
  static constexpr std::array<std::string_view, 3> kSkies = {"sky", "sun", "sunsky"};
  if (std::find(kSkies.begin(), kSkies.end(), object.plugin) != kSkies.end()) return true;
  return std::any_of(object.properties.begin(), object.properties.end(), [&](const Property& property) {
    if (property.type == PropertyType::rgb) return !is_gray(std::get<Rgb>(property.value));
    return names_colors(object, property);
  });
}

}  // namespace

bool has_color(const Object& scene) {
  std::unordered_set<const Object*> seen = {&scene};
  std::vector<const Object*> open = {&scene};
  while (!open.empty()) {
    const Object& object = *open.back();
    open.pop_back();
    if (has_own_color(object)) return true;
    for (const Child& child : object.children)
      if (child.object != nullptr && seen.insert(child.object.get()).second)
        open.push_back(child.object.get());
  }
  return false;
}

}  // namespace candela::description
