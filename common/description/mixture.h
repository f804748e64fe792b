// 0.6's bsdf 'mixturebsdf' as blends of two.
#pragma once

#include <cstddef>
#include <vector>

#include "common/base/result.h"
#include "common/description/resolve.h"

namespace candela::description::legacy {

// Turns the draft, which is called 'blendbsdf' by now, into a chain of blends: each takes its first bsdf or
// else goes on to the rest. What the weights lack of 1 goes to a black bsdf at the end; where their sum is
// above 1 they are divided by it, as 0.6 does.
Result<void> split_mixture(std::vector<Draft>& drafts, std::size_t index, std::vector<Note>& notes);

}  // namespace candela::description::legacy
