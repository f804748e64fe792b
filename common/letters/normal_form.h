// One text for light path expressions that are written differently and read the same.
#pragma once

#include <string>

#include "common/letters/expression.h"

namespace candela::letters {

// Equal texts have equal meanings: of spaces, parentheses that group nothing, X for [DGS], and the order in
// sets and of alternatives nothing is left. Different texts may still mean the same: LDE|LGE and L[DG]E.
std::string normal_form(const Node& node);

}  // namespace candela::letters
