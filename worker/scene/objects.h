// The names of a scene's objects, for light path expressions and mattes.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace candela::scene {

struct PathEdits;

// Objects by index: shapes with their materials, lamps, media. Shapes of the same names are one object.
struct SceneObjects {
  std::vector<std::vector<std::string>> names;
  std::vector<std::uint8_t> uses;  // letters::ObjectUse
  // By the index of the shape, the emitter, the medium.
  std::vector<std::uint32_t> of_shape, of_emitter, of_medium;
  // Names of mattes, each once, and by the index of the shape the number of its name.
  struct Mattes {
    std::vector<std::string> names;
    std::vector<std::uint32_t> of_shape;
  };
  Mattes object_mattes, material_mattes;
  // Edits that select by more of a path than their vertex, and what walks have to know of them
  // (bsdfs/path_edited.h); null: none. No bsdf of the scene has edits then.
  std::shared_ptr<const PathEdits> path_edits;
};

}  // namespace candela::scene
