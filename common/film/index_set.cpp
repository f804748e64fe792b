#include "common/film/index_set.h"

#include <algorithm>
#include <iterator>

namespace candela::film {

bool IndexSet::insert(std::uint64_t begin, std::uint64_t end) {
  if (begin >= end || intersects(begin, end)) return false;
  auto next = ranges_.lower_bound(begin);
  // Neighbors are joined, so that equal sets have equal ranges however they grew.
  if (next != ranges_.end() && next->first == end) {
    end = next->second;
    next = ranges_.erase(next);
  }
  if (next != ranges_.begin() && std::prev(next)->second == begin) {
    std::prev(next)->second = end;
  } else {
    ranges_.emplace_hint(next, begin, end);
  }
  return true;
}

bool IndexSet::intersects(std::uint64_t begin, std::uint64_t end) const {
  if (begin >= end) return false;
  const auto next = ranges_.lower_bound(begin);
  if (next != ranges_.end() && next->first < end) return true;
  return next != ranges_.begin() && std::prev(next)->second > begin;
}

std::uint64_t IndexSet::count() const {
  std::uint64_t total = 0;
  for (const auto& [begin, end] : ranges_) total += end - begin;
  return total;
}

std::pair<std::uint64_t, std::uint64_t> IndexSet::first_gap(std::uint64_t from, std::uint64_t limit) const {
  auto next = ranges_.upper_bound(from);
  if (next != ranges_.begin() && std::prev(next)->second > from) {
    from = std::prev(next)->second;  // ranges never touch, so a gap begins here
  }
  if (from >= limit) return {limit, limit};
  const std::uint64_t end = next == ranges_.end() ? limit : std::min(limit, next->first);
  return {from, end};
}

}  // namespace candela::film
