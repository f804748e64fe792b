// The names of a scene's objects, for light path expressions.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace candela::scene {

// Objects by index: shapes with their materials, lamps, media. Shapes of the same names are one object.
struct SceneObjects {
  std::vector<std::vector<std::string>> names;
  std::vector<std::uint8_t> uses;  // letters::ObjectUse
  // By the index of the shape, the emitter, the medium.
  std::vector<std::uint32_t> of_shape, of_emitter, of_medium;
};

}  // namespace candela::scene
