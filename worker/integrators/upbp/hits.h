// The photons or beams that a query of an eye path is expected to hit. Merges of one query share the eye
// path, while [Krivanek 2014] takes them for independent samples. The weights divide a merge's number of
// samples by 1 + expected hits, which bounds the shared part's variance (docs/integrators/upbp-method.md).
#pragma once

#include <cstdint>

#include "worker/transport/mis/factors.h"
#include "worker/transport/technique/merge_medium.h"

namespace candela::integrators::upbp {

// Expected in the first iteration; radii of later ones are smaller.
struct ExpectedHits : transport::ByMerge<double> {
  // Hits of an iteration with `paths` times as many light paths, `beam_paths` times as many of which leave
  // beams.
  ExpectedHits scaled(double paths, double beam_paths) const;
  // Hits of a later iteration.
  ExpectedHits in(std::uint64_t iteration) const;
  // Divides the number of samples of each kind of merge by 1 + its hits.
  void divide(transport::MediumMerges& eta) const;
};

// Counts queries and hits of iterations.
class HitCounts {
 public:
  void add(const transport::MergeWork& work, std::uint64_t iteration);
  ExpectedHits expected() const;  // 0 of kinds without queries

 private:
  // Each query counts as the kernel's share of the first iteration's volume.
  transport::ByMerge<double> merges_, queries_;
};

}  // namespace candela::integrators::upbp
