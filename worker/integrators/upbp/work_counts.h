// The work of upbp in counts, from which its pilot takes the costs of trials.
#pragma once

#include <cstdint>

namespace candela::transport {
struct MergeWork;
}

namespace candela::integrators::upbp {

// Work of rendering, in counts that are the same on every machine.
struct WorkCounts {
  std::uint64_t rays = 0;
  std::uint64_t queries = 0;
  std::uint64_t point_nodes = 0, beam_nodes = 0;       // of trees that queries looked into
  std::uint64_t point_merges = 0, beam_merges = 0;     // pairs that were weighted
  std::uint64_t searched = 0, points = 0, pieces = 0;  // that searches, and trees, were built of

  // In nanoseconds of one core, about, of a film of as many pixels whose iteration has `density` times as
  // many light paths: a query meets so many times as many points, and each pixel pays for that share of the
  // beams, of which an iteration has the same number. Nodes of points become smaller: a query beam crosses
  // more of them as the cube root of the density, and those whose points it meets grow as the merges.
  double cost(double density) const;

  // The queries, nodes and merges of an iteration.
  void add(const transport::MergeWork& work);
};

}  // namespace candela::integrators::upbp
