// How many photons or beams a query of an eye path meets. The merges of one eye path share its vertices: the
// more a query meets, the less each of them is worth as a sample. [Krivanek 2014] takes them for independent;
// the weights here divide a merge's number of samples by 1 + expected hits, a bound of what the part that
// they share adds to the variance (docs/decisions/069).
#pragma once

#include <cstdint>

#include "worker/transport/mis/factors.h"
#include "worker/transport/technique/merge_medium.h"

namespace candela::integrators::upbp {

// Expected in the first iteration; radii of later ones are smaller.
struct ExpectedHits : transport::ByMerge<double> {
  // Those of an iteration with `paths` times as many light paths, `beam_paths` times as many of which leave
  // beams.
  ExpectedHits scaled(double paths, double beam_paths) const;
  // The numbers of samples of an iteration, each over 1 + its hits.
  void divide(transport::MediumMerges& eta, std::uint64_t iteration) const;
};

// Counts of iterations.
class HitCounts {
 public:
  void add(const transport::MergeWork& work, std::uint64_t iteration);
  ExpectedHits expected() const;  // 0 of kinds without queries

 private:
  transport::ByMerge<double> merges_,
      queries_;  // queries: each by the share that its kernel has of the first one's
};

}  // namespace candela::integrators::upbp
