// Sums and differences of sets of sequence indices, for what a job has, owes and has lost.
#pragma once

#include <cstdint>

#include "common/film/index_text.h"

namespace candela::master {

using film::HalfSets;

// The indices of `a` that `b` lacks.
film::IndexSet without(const film::IndexSet& a, const film::IndexSet& b);
// The indices of either set.
film::IndexSet united(const film::IndexSet& a, const film::IndexSet& b);
// [0, end) without the indices of `a`.
film::IndexSet complement(const film::IndexSet& a, std::uint64_t end);
bool covers(const film::IndexSet& outer, const film::IndexSet& inner);
bool contains(const film::IndexSet& set, std::uint64_t begin, std::uint64_t end);
// Number of indices below `end` that the set lacks.
std::uint64_t missing(const film::IndexSet& set, std::uint64_t end);
// One past the largest index; 0 for an empty set.
std::uint64_t end_of(const film::IndexSet& set);

HalfSets without(const HalfSets& a, const HalfSets& b);
HalfSets united(const HalfSets& a, const HalfSets& b);
bool covers(const HalfSets& outer, const HalfSets& inner);
inline std::uint64_t count(const HalfSets& sets) {
  return sets[0].count() + sets[1].count();
}

}  // namespace candela::master
