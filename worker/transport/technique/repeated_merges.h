// Counts merges that repeat a light path: the F test takes the photons of a disc for independent samples, and
// two of one path are not [Lin 2023, section 5; a share of some percent makes the test alarm too often].
// Counted at a sample of the eye paths, beside the merges, so that the gather pays nothing for it.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "common/film/counts.h"
#include "common/rng/stream.h"
#include "worker/transport/technique/merge.h"

namespace candela::transport {

// True if the eye path of this key is of the sample: one of 128.
inline bool counts_repeats(std::uint64_t sample_key) {
  constexpr std::uint64_t kStream = 0x726570656174;  // "repeat"
  return rng::combine(sample_key, kStream) % 128 == 0;
}

// Adds the photons that v merges with, and those that are not the first of their light path among them. v is
// connectible. Photons without a contribution count too.
template <class Block>
void count_repeats(const MergeMaps<Block>& maps, const MergeScale& scale, const ScatterPoint& v,
                   film::SampleCounts& sample_counts) {
  const PhotonMap<Block>* map = maps.map_for(v);
  if (map == nullptr || !map->knows_paths()) return;
  std::vector<std::uint64_t> paths;
  const std::uint32_t max_edges = maps.max_edges - v.edges;
  map->visit_paths(v.hit.p, v.on_surface() ? scale.disc_radius : scale.ball_radius,
                   [&](const Photon<Block>& photon, std::uint64_t path) {
                     if (photon.edges <= max_edges && (v.on_surface() || photon.medium() == v.medium))
                       paths.push_back(path);
                   });
  std::sort(paths.begin(), paths.end());
  const auto different = std::unique(paths.begin(), paths.end()) - paths.begin();
  sample_counts.sampled_merges += paths.size();
  sample_counts.repeated_merges += paths.size() - static_cast<std::size_t>(different);
}

}  // namespace candela::transport
