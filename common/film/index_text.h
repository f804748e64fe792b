// Sets of sequence indices as text, as images carry them and people type them: "0-31,40-47,50" is [0, 32),
// [40, 48) and [50, 51), "none" is empty, and both halves of a job are "A/B".
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <string_view>

#include "common/base/result.h"
#include "common/film/index_set.h"

namespace candela::film {

// One set for each half of a job.
using HalfSets = std::array<IndexSet, 2>;

// Ranges of both halves together that a job may ask for: as many as fit into one argument of a command.
inline constexpr std::size_t kMaxIndexRanges = 4096;

std::string text_of(const IndexSet& set);
std::string text_of(const HalfSets& sets);

// Errors (usage) say what is wrong: text of another form, ranges that are out of order or touch each other,
// indices beyond Limits::max_iterations.
Result<IndexSet> parse_indices(std::string_view text);
// The same, and what check_indices() says.
Result<HalfSets> parse_half_indices(std::string_view text);

inline bool empty(const HalfSets& sets) {
  return sets[0].ranges().empty() && sets[1].ranges().empty();
}
// Fails unless a job can ask for these indices: some, below Limits::max_iterations, in at most
// kMaxIndexRanges.
Result<void> check_indices(const HalfSets& sets);

}  // namespace candela::film
