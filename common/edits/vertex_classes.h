// The classes of vertices that paths of a scene can have, and edits as expressions of whole paths.
#pragma once

#include <cstdint>
#include <set>
#include <span>
#include <string>

#include "common/edits/edits.h"
#include "common/letters/automaton.h"

namespace candela::edits {

struct VertexClasses {
  std::set<letters::Automaton::Class> lamps, surfaces, media;

  // objects, uses: as letters::Automaton::compile() has them; regions: the number of those of its request.
  VertexClasses(const letters::Automaton& automaton, std::span<const letters::ObjectNames> objects,
                std::span<const std::uint8_t> uses, std::size_t regions);
};

// Bytes that stand before the edit's expression in whole_path().
std::size_t bytes_before(const Edit& edit);
// An expression of whole paths, in which the selected vertex is the last or the first that scatters.
std::string whole_path(const Edit& edit);

}  // namespace candela::edits
