// Edits that a scene is to be built with.
#pragma once

#include <cstdint>
#include <vector>

#include "common/edits/edits.h"
#include "common/letters/alphabet.h"

namespace candela::scene {

struct EditRequest {
  edits::EditList list;
  // Objects of the scene's description, which may have more than what is built.
  std::vector<letters::ObjectNames> names;
  std::vector<std::uint8_t> uses;  // letters::ObjectUse of each
};

}  // namespace candela::scene
