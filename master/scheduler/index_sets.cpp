#include "master/scheduler/index_sets.h"

#include <algorithm>

namespace candela::master {

film::IndexSet without(const film::IndexSet& a, const film::IndexSet& b) {
  film::IndexSet out;
  for (const auto& [begin, end] : a.ranges())
    for (std::uint64_t at = begin; at < end;) {
      const auto [gap, gap_end] = b.first_gap(at, end);
      if (gap == gap_end) break;
      out.insert(gap, gap_end);
      at = gap_end;
    }
  return out;
}

film::IndexSet united(const film::IndexSet& a, const film::IndexSet& b) {
  film::IndexSet out = a;
  const film::IndexSet more = without(b, a);
  for (const auto& [begin, end] : more.ranges()) out.insert(begin, end);
  return out;
}

film::IndexSet complement(const film::IndexSet& a, std::uint64_t end) {
  film::IndexSet all;
  if (end > 0) all.insert(0, end);
  return without(all, a);
}

bool covers(const film::IndexSet& outer, const film::IndexSet& inner) {
  return without(inner, outer).ranges().empty();
}

bool contains(const film::IndexSet& set, std::uint64_t begin, std::uint64_t end) {
  const auto [gap, gap_end] = set.first_gap(begin, end);
  return gap == gap_end;
}

std::uint64_t missing(const film::IndexSet& set, std::uint64_t end) {
  std::uint64_t out = end;
  for (const auto& [from, to] : set.ranges()) {
    if (from >= end) break;
    out -= std::min(to, end) - from;
  }
  return out;
}

std::uint64_t end_of(const film::IndexSet& set) {
  return set.ranges().empty() ? 0 : set.ranges().rbegin()->second;
}

HalfSets without(const HalfSets& a, const HalfSets& b) {
  return {without(a[0], b[0]), without(a[1], b[1])};
}

HalfSets united(const HalfSets& a, const HalfSets& b) {
  return {united(a[0], b[0]), united(a[1], b[1])};
}

bool covers(const HalfSets& outer, const HalfSets& inner) {
  return covers(outer[0], inner[0]) && covers(outer[1], inner[1]);
}

}  // namespace candela::master
