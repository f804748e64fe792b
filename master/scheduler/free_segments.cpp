#include "master/scheduler/free_segments.h"

#include <algorithm>

namespace candela::master {

SegmentRun free_segments(const film::IndexSet& merged, const film::IndexSet& reserved,
                         std::uint64_t per_round, std::uint64_t target, std::uint64_t want) {
  SegmentRun longest;
  for (std::uint64_t at = 0; at < target;) {
    const auto [begin, end] = reserved.first_gap(at, target);
    if (begin == end) break;
    for (std::uint64_t from = begin; from < end;) {
      // The indices of the first round are free; from then on as far as the round before is merged.
      const std::uint64_t second = std::max(from, per_round);
      std::uint64_t blocked = end, free_again = end;
      if (second < end) {
        const auto [gap, gap_end] = merged.first_gap(second - per_round, end - per_round);
        if (gap != gap_end) {
          blocked = gap + per_round;
          free_again = gap_end + per_round;
        }
      }
      if (blocked - from > longest.length) longest = {from, blocked - from};
      if (longest.length >= want) return longest;
      from = free_again;
    }
    at = end;
  }
  return longest;
}

}  // namespace candela::master
