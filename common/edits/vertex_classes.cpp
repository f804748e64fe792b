#include "common/edits/vertex_classes.h"

#include <fmt/format.h>

namespace candela::edits {

using letters::Letter;
using letters::Side;

VertexClasses::VertexClasses(const letters::Automaton& automaton,
                             std::span<const letters::ObjectNames> objects,
                             std::span<const std::uint8_t> uses, std::size_t regions) {
  const std::uint32_t masks = 1u << regions;
  for (std::uint32_t object = 0; object < objects.size(); ++object) {
    const std::uint8_t use = uses.empty() ? std::uint8_t{7} : uses[object];
    if ((use & letters::kLampObject) != 0)
      lamps.insert(automaton.class_of(Letter::lamp, Side::none, object, 0));
    if ((use & letters::kSurfaceObject) == 0 && (use & letters::kMediumObject) == 0) continue;
    for (std::uint32_t mask = 0; mask < masks; ++mask) {
      if ((use & letters::kMediumObject) != 0)
        media.insert(automaton.class_of(Letter::volume, Side::none, object, mask));
      for (const Letter letter : {Letter::diffuse, Letter::glossy, Letter::specular})
        for (const Side side : {Side::reflected, Side::transmitted})
          if ((use & letters::kSurfaceObject) != 0)
            surfaces.insert(automaton.class_of(letter, side, object, mask));
    }
  }
}

std::size_t bytes_before(const Edit& edit) {
  return edit.direction == Edit::Direction::light ? 1 : 2;
}

std::string whole_path(const Edit& edit) {
  return edit.direction == Edit::Direction::light ? fmt::format("({})E", edit.select)
                                                  : fmt::format("L({})", edit.select);
}

}  // namespace candela::edits
