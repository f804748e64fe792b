// Materials of an OBJ file and its library, without the geometry.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace candela::description {

struct ObjOutline {
  std::string library;                 // of the last mtllib; empty: none
  std::vector<std::string> materials;  // of usemtl, each once, in the order of the file
  std::string last_material;
};
ObjOutline outline_of_obj(std::string_view bytes);

// One newmtl of a library, as Mitsuba 0.6 reads it. Colors are sRGB.
struct ObjMaterial {
  std::string name;
  int line = 0;
  int illumination = 0;  // illum
  std::array<double, 3> diffuse{}, specular{};
  double exponent = 0;
  std::optional<double> opacity;  // d, if it is not 1
  // Names of images, empty where there is none. Backslashes are slashes.
  std::string diffuse_map, specular_map, bump_map, opacity_map;
};
// If two have one name, the later one counts. Numbers that do not parse are 0.
std::vector<ObjMaterial> read_obj_materials(std::string_view bytes);

}  // namespace candela::description
