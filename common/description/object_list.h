// The objects of a scene, by the names that light path expressions know (object_names.h).
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/description/object.h"
#include "common/edits/edits.h"
#include "common/letters/alphabet.h"
#include "common/letters/request.h"

namespace candela::description {

// Input of letters::Automaton::compile(). A shape of a shapegroup is one object.
struct LetterObjects {
  std::vector<letters::ObjectNames> names;
  std::vector<std::uint8_t> uses;       // letters::ObjectUse of each
  std::vector<std::string> lamp_names;  // in the order of the file
};
LetterObjects letter_objects(const Object& scene);

// Compiles the expressions with the names of the scene, light groups and all. Errors: those of
// letters::Automaton.
Result<void> check_layers(const letters::LayerRequest& request, const Object& scene);

// The same of the expressions of edits. Errors: those of edits::Selection and edits::check_by_path().
Result<void> check_edits(const edits::EditList& list, const Object& scene);

struct Box {
  Vec3 low{}, high{};
};

// All that an expression means by one name.
struct NamedObjects {
  std::string name;                            // empty: all surfaces that have none
  std::map<std::string, std::uint64_t> kinds;  // plugins of its shapes, lamps or media, instances counted
  std::optional<Box> bounds;                   // nullopt: not known before the scene is built, or unbounded
  std::uint64_t count() const;
};

struct ObjectList {
  std::vector<NamedObjects> surfaces, lamps, media;  // in the order of the file
};
ObjectList list_objects(const Object& scene);

}  // namespace candela::description
