// Beams that light paths leave in media, in a tree (box_tree.h).
//
// A short beam ends where its flight ended. At s along it, it carries
//   throughput T(s) / P(s),     P: the probability that the flight passes s,
// which is the throughput itself where all channels have one sigma_t. [Krivanek 2014] In a grid that has
// colors neither T nor P is known; the weight that the flight had at s is an unbiased estimate of T over the
// same flights, so that the beam keeps the flight's steps.
//
// A long beam goes on to the end of its medium, whatever the flight did there, and carries throughput T(s).
// Beams are long in homogeneous media alone.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/base/result.h"
#include "worker/core/huge_pages.h"
#include "worker/scene/emitters/emitter.h"
#include "worker/transport/beams.h"
#include "worker/transport/box_tree.h"
#include "worker/transport/edge_start.h"
#include "worker/transport/letters/path_letters.h"
#include "worker/transport/vertex.h"

namespace candela::transport {

// An iteration has more than the trees can hold. what: in the plural, that light paths leave.
Error too_many_in_media(const char* what);

struct PhotonBeam {
  Vec3 origin, direction;  // unit
  float length;
  Spectrum throughput;  // at the origin
  std::uint32_t medium, edges;
  std::uint32_t emission;  // of first edges: index of the sample they came from
  std::uint32_t first_step, step_count;
};

// True if beams are made in a medium: those that scatter.
inline bool has_beams(const scene::Medium& medium) {
  return (medium.max_sigma_t() * medium.max_albedo()).max_component() > 0;
}

// The place along the ray of a crossing at which its beam ends. A long one ends at the latest when nothing is
// left of any channel that scatters. Precondition of is_long: the medium is homogeneous and has_beams().
float beam_end(const Crossing& crossing, const scene::Medium& medium, bool is_long);

// Beams of one chunk of light paths, in the order of its paths.
class BeamBuffer {
 public:
  void clear() {
    beams_.clear();
    starts_.clear();
    emissions_.clear();
    steps_.clear();
    states_.clear();
  }
  // states: of the letters before the beam's vertex; null: none, for all beams. Nothing of a medium without
  // beams, or that passes beside the grid. False: the numbers cannot be used.
  bool keep(const scene::Scene& scene, const Crossing& crossing, bool is_long, const EdgeStart& start,
            const scene::EmissionSample& emission, const ChannelStates* states = nullptr);

  std::span<const PhotonBeam> beams() const { return beams_; }
  std::span<const EdgeStart> starts() const { return starts_; }
  std::span<const scene::EmissionSample> emissions() const { return emissions_; }
  std::span<const scene::FlightStep> steps() const { return steps_; }
  std::span<const ChannelStates> states() const { return states_; }

 private:
  std::vector<PhotonBeam> beams_;
  std::vector<EdgeStart> starts_;  // of each beam
  std::vector<scene::EmissionSample> emissions_;
  std::vector<scene::FlightStep> steps_;
  std::vector<ChannelStates> states_;  // of each beam; empty: nobody asks for letters
};

// An iteration's beams, cut into pieces of kPieceRadii radii.
class PhotonBeams {
 public:
  static constexpr double kPieceRadii = 8;
  static constexpr std::uint32_t kMaxPieces = 64;  // of a beam

  // From the buffers in their order. radii: of the queries, by the number of the medium. The result does not
  // depend on `threads`.
  Result<void> build(std::span<const BeamBuffer* const> chunks, std::span<const float> radii,
                     unsigned threads);

  std::size_t size() const { return beams_.size(); }
  std::size_t pieces() const { return pieces_.size(); }
  const EdgeStart& start(const PhotonBeam& beam) const { return starts_[index_of(beam)]; }
  const scene::EmissionSample& emission(const PhotonBeam& beam) const { return emissions_[beam.emission]; }
  std::span<const scene::FlightStep> steps(const PhotonBeam& beam) const {
    return {steps_.data() + beam.first_step, beam.step_count};
  }
  // Its letters' states. Precondition: the buffers kept them.
  const ChannelStates& states(const PhotonBeam& beam) const { return states_[index_of(beam)]; }
  std::uint64_t bytes() const;

  // visit(beam, Projection): beams that pass p within the radius, beside their own length. This and what
  // follows return how many nodes of the tree were looked into.
  template <class Visit>
  std::uint64_t near_point(Vec3 p, float radius, Visit&& visit) const {
    const double r2 = static_cast<double>(radius) * static_cast<double>(radius);
    return tree_.near_point(p, radius, [&](std::uint32_t slot) {
      const Piece& piece = pieces_[slot];
      const PhotonBeam& beam = beams_[piece.beam];
      const Projection at = project(beam.origin, beam.direction, p);
      if (at.distance_squared < r2 && inside(piece, beam, at.along)) visit(beam, at);
    });
  }
  // visit(beam, Approach): beams whose closest approach to the segment is within the radius, and within the
  // length of both. a of the Approach: the segment.
  template <class Visit>
  std::uint64_t near_segment(const QuerySegment& s, float radius, Visit&& visit) const {
    const auto r = static_cast<double>(radius), end_t = static_cast<double>(s.length);
    return tree_.near_segment(s, radius, [&](std::uint32_t slot) {
      const Piece& piece = pieces_[slot];
      const PhotonBeam& beam = beams_[piece.beam];
      const LinePair lines(s.origin, s.direction, beam.origin, beam.direction);
      if (!lines.may_be_within(r)) return;  // most: the root and two divisions are spared
      const Approach at = lines.approach();
      if (at.sine > 0 && at.distance < r && at.along_a >= 0 && at.along_a < end_t &&
          inside(piece, beam, at.along_b))
        visit(beam, at);
    });
  }

 private:
  // [length index / count, length (index + 1) / count) of a beam: each place is in one piece.
  struct Piece {
    std::uint32_t beam;
    std::uint16_t index, count;
  };
  static double begin(std::uint32_t index, std::uint32_t count, float length) {
    return static_cast<double>(length) * index / count;
  }
  static bool inside(const Piece& piece, const PhotonBeam& beam, double s) {
    return s >= begin(piece.index, piece.count, beam.length) &&
           s < begin(piece.index + 1u, piece.count, beam.length);
  }
  std::size_t index_of(const PhotonBeam& beam) const {
    return static_cast<std::size_t>(&beam - beams_.data());
  }

  BoxTree tree_;
  HugeVector<Piece> pieces_;  // by slot
  HugeVector<PhotonBeam> beams_;
  std::vector<EdgeStart> starts_;
  std::vector<scene::EmissionSample> emissions_;
  std::vector<scene::FlightStep> steps_;
  std::vector<ChannelStates> states_;  // of each beam; empty: nobody asks for letters
};

}  // namespace candela::transport
