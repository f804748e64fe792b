// Photons that light paths leave in media: those around a place by a range search in each medium
// (range_search.h), and those beside a segment by a tree (box_tree.h).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "worker/core/huge_pages.h"
#include "worker/transport/beams.h"
#include "worker/transport/box_tree.h"
#include "worker/transport/photon_map.h"
#include "worker/transport/range_search.h"

namespace candela::transport {

class PhotonPoints {
 public:
  // The queries to come.
  struct Queries {
    std::span<const float> radii;           // of near_point(), by the number of the medium; empty: none
    bool segments = false;                  // near_segment()
    const scene::Scene* hazards = nullptr;  // hazard(), of this scene; null: none
  };

  // From the buffers in their order. The result does not depend on `threads`.
  Result<void> build(std::span<const PhotonBuffer<MisBlock>* const> chunks, const Queries& queries,
                     unsigned threads);

  std::size_t size() const { return photons_.size(); }
  std::uint64_t bytes() const;
  // The hazard of the place of a photon that a visit saw (hazard_of).
  float hazard(const Photon<MisBlock>& photon) const { return hazards_[index_of(photon)]; }
  // The survival of the edge by which light arrived; 1 if the buffers did not keep it.
  float survival(const Photon<MisBlock>& photon) const {
    return survivals_.empty() ? 1.0f : survivals_[index_of(photon)];
  }

  // Its letters' states. Precondition: the buffers kept them.
  const ChannelStates& states(const Photon<MisBlock>& photon) const { return states_[index_of(photon)]; }

  // In steps, with other work between them: prefetch() and find() are RangeSearch's, near_point() calls
  // visit(photon, squared distance) for the photons of the medium that find() was asked for.
  void prefetch(std::uint32_t medium, Vec3 p, float radius) const {
    searches_[medium].points.prefetch(p, radius);
  }
  void find(std::uint32_t medium, Vec3 p, float radius, RangeSearch::Query& query) const {
    searches_[medium].points.find(p, radius, query);
  }
  template <class Visit>
  void near_point(std::uint32_t medium, const RangeSearch::Query& query, Visit&& visit) const {
    const MediumSearch& search = searches_[medium];
    search.points.visit_slots(query, [&](std::uint32_t slot, float d2) {
      slot += search.first;
      visit(photons_[found_.empty() ? slot : found_[slot]], d2);
    });
  }
  // visit(photon, Projection): photons of any medium whose projection lies on the segment. Returns how many
  // nodes of the tree were looked into.
  template <class Visit>
  std::uint64_t near_segment(const QuerySegment& s, float radius, Visit&& visit) const {
    const double r2 = static_cast<double>(radius) * static_cast<double>(radius);
    return tree_.near_segment(s, radius, [&](std::uint32_t slot) {
      const Projection at = project(s.origin, s.direction, positions_[slot]);
      if (at.distance_squared < r2 && at.along >= 0 && at.along < static_cast<double>(s.length))
        visit(photons_[slot], at);
    });
  }

 private:
  struct MediumSearch {
    RangeSearch points;
    std::uint32_t first = 0;  // of found_; without it, of photons_
  };

  std::size_t index_of(const Photon<MisBlock>& photon) const {
    return static_cast<std::size_t>(&photon - photons_.data());
  }
  void reorder(std::span<const std::uint32_t> order);
  void build_searches(std::span<const float> radii, unsigned threads);

  BoxTree tree_;
  std::vector<MediumSearch> searches_;
  // In the order of the tree's slots; without it, in that of the searches.
  HugeVector<Vec3> positions_;
  HugeVector<Photon<MisBlock>> photons_;
  HugeVector<float> hazards_, survivals_;  // empty if nobody asks for them
  HugeVector<ChannelStates> states_;       // likewise
  HugeVector<std::uint32_t> found_;        // with tree and searches: the photons that the searches find
};

}  // namespace candela::transport
