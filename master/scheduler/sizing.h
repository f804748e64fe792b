// Computes the size of a unit: pure arithmetic.
#pragma once

#include <cstdint>

namespace candela::master {

struct SizingInput {
  double unit_seconds = 4;           // what a unit should take
  double seconds_per_iteration = 0;  // on the worker that asks; 0: unknown
  double overhead_seconds = 0;       // of receiving and merging one delta of this job
  double merge_seconds = 0;          // of that, the time in which the master can do nothing like it, or, if
                                     // that is more, CPU time
  std::uint64_t remaining = 0;       // iterations of the job not cut into units yet; 0: no end in sight
  std::uint64_t active_workers = 1;  // that can take units of this job
  double seconds_left = 0;           // of a time limit; 0: none
  bool open_end = false;             // an error or a time will end the job: nobody knows at which iteration
  std::uint64_t cut_so_far = 0;      // iterations of the job cut into units already
};

// Iterations for the next unit, at least 1 (the caller cuts it at the end of the half).
//  - unit_seconds of work, or more where a delta is dear: receiving and merging it shall cost under 2 % of
//  rendering it
//    (up to 16 times unit_seconds);
//  - so long that the deltas of all active workers take at most two fifths of the time: what is not
//  measured, of the network, checkpoints and estimates, takes nearly as much (up to 64 times unit_seconds);
//  - guided self-scheduling near the end: at most remaining / (2 active_workers), so that all workers end
//  together; but a unit is not shorter than the time that merging all units of its size takes: with r seconds
//  of work left and m a merge, units of u seconds are rendered in r / (r / u) = u and merged in m r / u, so
//  u = sqrt(m r);
//  - not more than an eighth of what a time limit leaves;
//  - at most what has been cut so far, shared by the workers, so that there is a picture soon; where the end
//  is open an eighth of that, so that the job neither runs far past its end nor ends with one half of its
//  film empty; from a sixteenth of unit_seconds, and from what the merge of all workers' deltas takes, on;
//  - the first four units of each half take a sixteenth of unit_seconds, whatever the number of workers: one
//  of several soon arrives, though the worker of another may be slow or still send something else.
std::uint64_t unit_iterations(const SizingInput& in);

inline constexpr std::uint64_t kMaxUnitIterations = 16384;

}  // namespace candela::master
