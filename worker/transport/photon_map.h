// Light vertices kept to be merged with eye vertices: photons, in the order of a range search's slots.
//
// A photon estimates radiance times the cosine at its surface (per area), or radiance (per volume, flux
// already divided by the sigma_s that the walk put into its throughput): the eye's vertex brings its own.
// The block that weights need (Block: that of a policy, mis/) is kept as floats, which hold 24 bits of sums
// that are compared with others; where they cannot hold the magnitude they saturate.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "common/base/result.h"
#include "worker/core/huge_pages.h"
#include "worker/transport/letters/path_letters.h"
#include "worker/transport/range_search.h"
#include "worker/transport/vertex.h"

namespace candela::transport {

// A vertex's block as a photon keeps it.
template <class Block>
struct StoredBlock;
template <>
struct StoredBlock<NoBlock> {
  void store(const NoBlock& /*block*/) {}
  NoBlock block() const { return {}; }
};
template <>
struct StoredBlock<MisBlock> {
  float known = 0, pending = 0, pending_surface = 0, pending_medium = 0;

  void store(const MisBlock& block) {
    known = saturated(block.known);
    pending = saturated(block.pending);
    pending_surface = saturated(block.pending_surface);
    pending_medium = saturated(block.pending_medium);
  }
  MisBlock block() const {
    return {static_cast<double>(known), static_cast<double>(pending), static_cast<double>(pending_surface),
            static_cast<double>(pending_medium)};
  }
  static float saturated(double value) {
    return static_cast<float>(std::min(value, static_cast<double>(std::numeric_limits<float>::max())));
  }
};

template <class Block>
struct Photon {
  Vec3 wo;        // unit, world, towards where the light came from
  Spectrum flux;  // of one light path; W, in a medium W m
  [[no_unique_address]] StoredBlock<Block> weights;
  std::uint32_t edges : 31 = 0;        // from the light
  std::uint32_t lit_by_delta : 1 = 0;  // as ScatterPoint has it
  // In a medium its index, on a surface the bits of ScatterPoint::arrival: the cosine of wo with the true
  // normal.
  std::uint32_t medium_or_cosine = scene::kNone;

  std::uint32_t medium() const { return medium_or_cosine; }
  float cosine() const { return std::bit_cast<float>(medium_or_cosine); }
};
static_assert(sizeof(Photon<MisBlock>) == 48 && sizeof(Photon<NoBlock>) == 32);

// Photons of one chunk of light paths, in the order of its paths and their vertices.
template <class Block>
class PhotonBuffer {
 public:
  void clear() {
    positions_.clear();
    photons_.clear();
    survivals_.clear();
    states_.clear();
    ends_.clear();
  }
  // Precondition: v is connectible. False: its place or flux cannot be used, and nothing is kept.
  // with_survival, states (of the letters before v; null: none): the same for all photons.
  bool keep(const scene::Scene& scene, const Vertex<Block>& v, bool with_survival = false,
            const ChannelStates* states = nullptr);
  // Once after each path, if its photons are to be known by it.
  void end_path() { ends_.push_back(static_cast<std::uint32_t>(photons_.size())); }
  // Drops the photons from number `size` on. Precondition: paths are not known.
  void drop_from(std::size_t size);
  // Multiplies the flux of photons [begin, end).
  void scale_flux(std::size_t begin, std::size_t end, float factor);

  std::size_t size() const { return photons_.size(); }
  std::span<const Vec3> positions() const { return positions_; }
  std::span<const Photon<Block>> photons() const { return photons_; }
  // ScatterPoint::survival of each photon; empty: not kept.
  std::span<const float> survivals() const { return survivals_; }
  // States of each photon's letters; empty: not kept.
  std::span<const ChannelStates> states() const { return states_; }
  // The number of photons after each path; empty: paths are not known.
  std::span<const std::uint32_t> ends() const { return ends_; }

 private:
  std::vector<Vec3> positions_;
  std::vector<Photon<Block>> photons_;
  std::vector<float> survivals_;
  std::vector<ChannelStates> states_;
  std::vector<std::uint32_t> ends_;
};

template <class Block>
class PhotonMap {
 public:
  // From the buffers in their order. radius: that of the queries. More than 2^32 - 9 photons are an error.
  // The result does not depend on the number of threads.
  Result<void> build(std::span<const PhotonBuffer<Block>* const> chunks, float radius, unsigned threads);

  std::size_t size() const { return photons_.size(); }
  // Precondition: collect() found the photon.
  Vec3 position(const Photon<Block>& photon) const {
    return search_.position(static_cast<std::uint32_t>(&photon - photons_.data()));
  }
  // Its letters' states. Precondition: the buffers kept them.
  const ChannelStates& states(const Photon<Block>& photon) const {
    return states_[static_cast<std::size_t>(&photon - photons_.data())];
  }
  // Its number in the order of the buffers. Precondition: the buffers knew paths.
  std::uint32_t number(const Photon<Block>& photon) const {
    return search_.order()[static_cast<std::size_t>(&photon - photons_.data())];
  }
  // Held between build and the next one.
  std::uint64_t bytes() const {
    return search_.bytes() + photons_.capacity() * sizeof(Photon<Block>) +
           ends_.capacity() * sizeof(std::uint32_t);
  }

  // Calls visit(photon, the number of its light path) for the photons within the radius. Precondition: the
  // buffers knew paths.
  template <class Visit>
  void visit_paths(Vec3 p, float radius, Visit&& visit) const {
    search_.visit_slots(p, radius, [&](std::uint32_t slot, float /*d2*/) {
      const auto end = std::upper_bound(ends_.begin(), ends_.end(), search_.order()[slot]);
      visit(photons_[slot], static_cast<std::uint64_t>(end - ends_.begin()));
    });
  }
  bool knows_paths() const { return !ends_.empty(); }

  // The steps of a query: others can work while memory is fetched. prefetch() and find() are RangeSearch's;
  // collect() finds the photons and asks for them.
  using Query = RangeSearch::Query;
  struct Hits {
    struct Hit {
      const Photon<Block>* photon;
      float d2;
    };
    static constexpr std::uint32_t kMax = 64;
    std::uint32_t count = 0;
    Hit hit[kMax];
  };
  void prefetch(Vec3 p, float radius) const { search_.prefetch(p, radius); }
  void find(Vec3 p, float radius, Query& query) const { search_.find(p, radius, query); }
  // Collects up to kMax photons into `hits`. On overflow it calls visit(photon, squared distance) for full
  // batches; the caller visits the rest. The order depends on the photons alone.
  template <class Visit>
  void collect(const Query& query, Hits& hits, Visit&& visit) const {
    hits.count = 0;
    search_.visit_slots(query, [&](std::uint32_t slot, float d2) {
      if (hits.count == Hits::kMax) {
        for (const auto& hit : hits.hit) visit(*hit.photon, hit.d2);
        hits.count = 0;
      }
      const Photon<Block>* photon = &photons_[slot];
      __builtin_prefetch(photon);
      hits.hit[hits.count++] = {photon, d2};
    });
  }

 private:
  RangeSearch search_;
  HugeVector<Photon<Block>> photons_;  // by slot
  HugeVector<Vec3> positions_;         // by index; room kept between builds
  HugeVector<Photon<Block>> by_index_;
  std::vector<ChannelStates> states_;  // by slot; empty: nobody asks for letters
  std::vector<std::uint32_t> ends_;    // the number of photons after each path
};

}  // namespace candela::transport
