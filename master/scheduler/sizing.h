// How large a unit is: pure arithmetic.
#pragma once

#include <cstdint>

namespace candela::master {

struct SizingInput {
  double unit_seconds = 4;           // what a unit should take
  double seconds_per_iteration = 0;  // on the worker that asks; 0: unknown
  double overhead_seconds = 0;       // of receiving and merging one delta of this job
  std::uint64_t remaining = 0;       // iterations of the job not cut into units yet; 0: no end in sight
  std::uint64_t active_workers = 1;  // that can take units of this job
  double seconds_left = 0;           // of a time limit; 0: none
};

// Iterations for the next unit, at least 1 (the caller cuts it at the end of the half).
//  - unit_seconds of work, or more where a delta is dear: receiving and merging it shall cost under 2 % of
//  rendering it
//    (up to 16 times unit_seconds);
//  - guided self-scheduling near the end: at most remaining / (2 active_workers), so that all workers end
//  together;
//  - not more than half of what a time limit leaves.
std::uint64_t unit_iterations(const SizingInput& in);

inline constexpr std::uint64_t kMaxUnitIterations = 16384;

}  // namespace candela::master
