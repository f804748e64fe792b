// Finds segments of Markov chains that can be cut into a unit now: pure logic.
#pragma once

#include <cstdint>

#include "common/film/index_set.h"

namespace candela::master {

struct SegmentRun {
  std::uint64_t begin = 0, length = 0;
};

// The first run of at least `want` indices of a half below `target` that are not reserved and whose chains'
// segments before (a round of `per_round` indices earlier) are merged; where none is as long, the longest.
// Length 0: there is none now. A run may be longer than `want`, and than a round.
SegmentRun free_segments(const film::IndexSet& merged, const film::IndexSet& reserved,
                         std::uint64_t per_round, std::uint64_t target, std::uint64_t want);

}  // namespace candela::master
