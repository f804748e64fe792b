#include "worker/transport/photon_points.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <numeric>

#include "worker/transport/photon_beams.h"
#include "worker/transport/vertex.h"

namespace candela::transport {

Result<void> PhotonPoints::build(std::span<const PhotonBuffer<MisBlock>* const> chunks,
                                 const Queries& queries, unsigned threads) {
  positions_.clear();
  photons_.clear();
  survivals_.clear();
  states_.clear();
  for (const PhotonBuffer<MisBlock>* chunk : chunks) {
    positions_.insert(positions_.end(), chunk->positions().begin(), chunk->positions().end());
    photons_.insert(photons_.end(), chunk->photons().begin(), chunk->photons().end());
    survivals_.insert(survivals_.end(), chunk->survivals().begin(), chunk->survivals().end());
    states_.insert(states_.end(), chunk->states().begin(), chunk->states().end());
  }
  if (photons_.size() > BoxTree::kMaxItems) return too_many_in_media("photons");
  if (queries.segments) reorder(tree_.build(std::span<const Vec3>(positions_), threads));
  if (!queries.radii.empty()) {
    build_searches(queries.radii, threads);
    if (!queries.segments) {
      reorder(found_);
      HugeVector<std::uint32_t>().swap(found_);
    }
  }
  hazards_.clear();
  if (queries.hazards != nullptr) {
    hazards_.resize(photons_.size());
    tbb::task_arena arena(static_cast<int>(std::max(1u, threads)));
    arena.execute([&] {
      tbb::parallel_for(std::size_t{0}, photons_.size(), [&](std::size_t i) {
        hazards_[i] = hazard_of(queries.hazards->medium(photons_[i].medium()).sigma_t(positions_[i]));
      });
    });
  }
  return {};
}

void PhotonPoints::reorder(std::span<const std::uint32_t> order) {
  positions_ = permuted(std::span<const Vec3>(positions_), order);
  photons_ = permuted(std::span<const Photon<MisBlock>>(photons_), order);
  if (!survivals_.empty()) survivals_ = permuted(std::span<const float>(survivals_), order);
  if (!states_.empty()) states_ = permuted(std::span<const ChannelStates>(states_), order);
}

// Leaves in found_ the index of each search's slots, one medium after another.
void PhotonPoints::build_searches(std::span<const float> radii, unsigned threads) {
  const auto medium_of = [&](std::uint32_t i) { return photons_[i].medium(); };
  std::vector<std::uint32_t> next(radii.size() + 1, 0);  // of the photons by medium
  for (std::uint32_t i = 0; i < photons_.size(); ++i) ++next[medium_of(i) + 1];
  std::partial_sum(next.begin(), next.end(), next.begin());
  searches_.resize(radii.size());
  for (std::size_t m = 0; m < radii.size(); ++m) searches_[m].first = next[m];
  const std::vector<std::uint32_t> ends(next.begin() + 1, next.end());
  HugeVector<std::uint32_t> by_medium(photons_.size());
  HugeVector<Vec3> places(photons_.size());
  for (std::uint32_t i = 0; i < photons_.size(); ++i) {
    const std::uint32_t to = next[medium_of(i)]++;
    by_medium[to] = i;
    places[to] = positions_[i];
  }
  found_.resize(photons_.size());
  for (std::size_t m = 0; m < radii.size(); ++m) {
    MediumSearch& search = searches_[m];
    const std::span<const Vec3> points(places.data() + search.first, ends[m] - search.first);
    search.points.build(points, radii[m], threads);
    for (std::uint32_t slot = 0; slot < points.size(); ++slot)
      found_[search.first + slot] = by_medium[search.first + search.points.order()[slot]];
    search.points.forget_order();
  }
}

std::uint64_t PhotonPoints::bytes() const {
  std::uint64_t sum = tree_.bytes() + positions_.capacity() * sizeof(Vec3) +
                      photons_.capacity() * sizeof(Photon<MisBlock>) +
                      states_.capacity() * sizeof(ChannelStates) +
                      (hazards_.capacity() + survivals_.capacity()) * sizeof(float) +
                      found_.capacity() * sizeof(std::uint32_t);
  for (const MediumSearch& search : searches_) sum += search.points.bytes();
  return sum;
}

}  // namespace candela::transport
