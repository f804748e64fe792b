// 0.6's 'mixturebsdf' and 'mixturephase' as blends of two.
#pragma once

#include <cstddef>
#include <vector>

#include "common/base/result.h"
#include "common/description/resolve.h"

namespace candela::description::legacy {

// Turns the draft, which is called 'blendbsdf' or 'blendphase' by now, into a chain of blends: each takes its
// first part or else goes on to the rest. What the weights of bsdfs lack of 1 goes to a black bsdf at the
// end; if their sum is above 1 they are divided by it, those of phase functions always, as 0.6 does.
Result<void> split_mixture(std::vector<Draft>& drafts, std::size_t index, std::vector<Note>& notes);

}  // namespace candela::description::legacy
