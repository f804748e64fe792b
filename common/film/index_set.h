// The iterations or segments in a film: law 3 takes idempotence from the set of merged indices.
#pragma once

#include <cstdint>
#include <map>
#include <utility>

namespace candela::film {

// Disjoint sorted half-open ranges of sequence indices.
class IndexSet {
 public:
  // Adds [begin, end). False, and nothing changed, if it is empty or overlaps what is there.
  bool insert(std::uint64_t begin, std::uint64_t end);
  bool intersects(std::uint64_t begin, std::uint64_t end) const;
  std::uint64_t count() const;
  // The first gap at or after `from`, cut to `limit`: {begin, end}, empty (begin == end) if there is none
  // below limit.
  std::pair<std::uint64_t, std::uint64_t> first_gap(std::uint64_t from, std::uint64_t limit) const;
  const std::map<std::uint64_t, std::uint64_t>& ranges() const { return ranges_; }  // begin -> end
  bool operator==(const IndexSet&) const = default;

 private:
  std::map<std::uint64_t, std::uint64_t> ranges_;
};

}  // namespace candela::film
