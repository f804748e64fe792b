// Prefixes of a job's indices at which a stop by error estimates the error. The schedule is a function of the
// job, so the stop and the image do not depend on who rendered what, or in which order.
//
// Lengths are in rounds of a half: indices, but of a job of chains segments of each chain of the half.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

namespace candela {

// Both halves have as many at least when a job ends by its error.
inline constexpr std::uint64_t kFirstPrefix = 8;

// The shortest prefix of the schedule that has at least so many rounds. `chains`: a round is much work.
std::uint64_t prefix_of(std::uint64_t rounds, bool chains);
// The one after a prefix of the schedule: a twentieth longer, and at the beginning by so much that a large
// farm has something to do meanwhile.
std::uint64_t prefix_after(std::uint64_t prefix, bool chains);

// The prefix that a job's film is cut at: deltas from its ends on are summed apart until it is decided. A
// later version replaces an earlier one.
struct PrefixBorder {
  static constexpr std::uint64_t kNone = std::numeric_limits<std::uint64_t>::max();
  std::array<std::uint64_t, 2> end = {kNone, kNone};  // indices, by half
  std::uint64_t version = 0;
};

// The error at a prefix, as estimated.
struct DecidedPrefix {
  std::uint64_t rounds = 0;
  double relmse_upper = 0;
  bool operator==(const DecidedPrefix&) const = default;
};
// Returns true if a stop rule of `relmse` ends the job at this prefix: the error was at most `relmse` at it,
// and at all earlier ones back to one that is at least a tenth shorter. `decided`: in order, this prefix
// included.
bool ends_at(const std::vector<DecidedPrefix>& decided, std::uint64_t prefix, double relmse);

}  // namespace candela
